//! Trajectories, their file formats and their evaluation: the ground on which visual-inertial odometry is judged.
