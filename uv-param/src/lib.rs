//! Metric parametrization of triangle meshes: ARAP charts, texture extraction, and the map between texel and surface.
