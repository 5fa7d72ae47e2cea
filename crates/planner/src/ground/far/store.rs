//! Saving and loading a graph: lines of text, a version first.
