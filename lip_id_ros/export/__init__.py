"""An identified arm in the formats of other programs: URDF, MJCF and C."""
