"""Units of a rig file's keys in those of the program (mm, rad, kg, N), and standard gravity."""

MM_PER_UM = 1e-3
RAD_PER_MRAD = 1e-3
RAD_PER_URAD = 1e-6
RAD_PER_NRAD = 1e-9
PPM = 1e-6  # of um/m and ppm
GRAVITY = 9.80665  # m/s^2, the standard acceleration of free fall
