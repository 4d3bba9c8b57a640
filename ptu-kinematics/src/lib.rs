//! Kinematics of an airframe with an arm, a pan-tilt unit and a nozzle: forward, inverse, Jacobian, limits, aiming, servo model.
