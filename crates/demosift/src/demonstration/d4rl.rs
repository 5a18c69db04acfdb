//! The D4RL layout in HDF5.
