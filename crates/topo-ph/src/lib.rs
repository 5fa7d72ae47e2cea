//! topo-ph
