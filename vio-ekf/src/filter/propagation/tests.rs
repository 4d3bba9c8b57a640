//! The propagation against the nominal model.

mod first_order;
mod second_order;
mod support;
