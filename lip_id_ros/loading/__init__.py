"""Sources of any kind to a data set, with preprocessing as it is given or selected."""

from lip_id_ros.loading.data_settings import with_selected
from lip_id_ros.loading.load import load_dataset

__all__ = ['load_dataset', 'with_selected']
