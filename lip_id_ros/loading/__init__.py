"""Sources of any kind to a data set, with preprocessing as it is given or elected."""

from lip_id_ros.loading.load import load_dataset, with_elected

__all__ = ['load_dataset', 'with_elected']
