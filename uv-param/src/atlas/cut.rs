//! Seams: what they cost, the graph that they form, their shortest paths, and those that only the page asks for.

pub(in crate::atlas) mod box_cutter;
pub(in crate::atlas) mod cut_graph;
pub(in crate::atlas) mod seam_cost;
pub(in crate::atlas) mod seam_graph;
pub(in crate::atlas) mod straighten;
