//! How an op changes the graph: all or nothing, with every touched node recorded, and its consequences in the same event.
