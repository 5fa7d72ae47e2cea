//! octant-prompt
