//! Tasks in MuJoCo.
