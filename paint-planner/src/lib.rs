//! From strokes on a surface to nozzle states, vehicle headings and a trajectory within limits.
