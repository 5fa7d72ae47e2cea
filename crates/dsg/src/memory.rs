//! What the builder remembers of an object besides the node: its points with their recency, and captions per label.

/// Memory of one object.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ObjectMemory {}
