//! What the crate promises, against closed forms, brute force, other programs and recordings.

#![allow(clippy::unwrap_used, reason = "a test may panic, in its helpers too")]

mod accel_matrix;
mod axes_diagnosis;
mod calibration_doubt;
mod camera;
mod dead_reckoning;
mod evaluation;
mod evo;
mod filter_abuse;
mod filter_consistency;
mod filter_images;
mod filter_initialization;
mod filter_points;
mod filter_stationary;
mod filter_stereo;
mod formats;
mod fusion;
mod fusion_input;
mod imu_pair;
mod imu_validation;
mod lie;
mod map_aided;
mod max_measured;
mod memory;
mod motion_blur;
mod own_camera_model;
mod own_measurement;
mod own_picture;
mod programs;
#[cfg(feature = "yaml")]
mod recordings;
mod rolling_shutter;
mod run;
mod sim;
#[cfg(feature = "yaml")]
mod sphere_models;
mod spline;
mod static_view;
mod support;
#[cfg(feature = "tune")]
mod tune;
mod unified;
