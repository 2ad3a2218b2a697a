//! Scenes that are part of the binary.
