"""One module of small searches per kind of evidence; `lip_id_ros.health.table` lists them."""
