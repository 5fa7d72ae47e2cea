//! volumetric-map
