//! What the nozzle does where no paint can be placed.

use super::lattice::Lattice;

/// Speeds that bring the nozzle to rest as fast as the change of speed allows, and keep it there.
pub(super) fn brake(lattice: &Lattice) -> Vec<i32> {
    let (mut cell, mut speed) = (0, lattice.start_speed());
    (0..lattice.horizon)
        .map(|_| {
            speed = lattice.next_speeds(cell, speed).min_by_key(|next| next.abs()).unwrap_or(0);
            cell += speed;
            speed
        })
        .collect()
}
