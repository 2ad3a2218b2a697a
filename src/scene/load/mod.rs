//! A file to a [`Scene`](super::Scene), or an error with file and place.
