//! After their start the estimators claim no memory.

// A global allocator can only be written with unsafe code; this one counts and passes on.
#![allow(unsafe_code, reason = "counting allocations needs a global allocator")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use crate::support::flight::Flight;
use vio_ekf::fusion::{FusionSettings, PoseFusion, PoseMeasurement, PoseSource};
use vio_ekf::inertial::InitialSigma;
use vio_ekf::{ImageView, Settings, Stamp, Vio};

struct Counting;

thread_local! {
    /// Of this thread: the test harness has threads of its own, which allocate when they please.
    static COUNT: Cell<usize> = const { Cell::new(0) };
}

// SAFETY: every call is passed on unchanged to the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.set(COUNT.get() + 1);
        // SAFETY: the caller's promises are those that `System` asks for.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn allocations(mut job: impl FnMut()) -> usize {
    let before = COUNT.get();
    job();
    COUNT.get() - before
}

/// Neither for a sample, nor for an image, nor for new landmarks.
#[test]
fn the_filter_allocates_nothing() {
    let mut flight = Flight::new(1, 4.0);
    let start = flight.drawn_start(InitialSigma::default());
    let mut other = flight.camera;
    other.body_from_camera.translation.y -= 0.11;
    let mut vio = Vio::stereo(flight.camera, other, flight.noise, Settings::default()).unwrap();
    let mut picture = vec![0_u8; 752 * 480];
    for (k, pixel) in picture.iter_mut().enumerate() {
        *pixel = if (k % 752 / 24 + k / 752 / 24) % 2 == 0 { 50 } else { 180 };
    }
    for (k, stamp) in flight.stamps().enumerate().take(600) {
        let sample = flight.imu(stamp);
        if k == 0 {
            vio.imu(&sample).unwrap();
            vio.initialize(&start).unwrap();
            continue;
        }
        assert_eq!(allocations(|| assert!(vio.imu(&sample).is_ok())), 0, "sample {k}");
        assert_eq!(allocations(|| assert!(vio.output().is_some())), 0, "output {k}");
        if k % 10 == 0 {
            // First points, then images, then pairs of them: with the change all landmarks are lost and new ones begin.
            let (seen, view) = (flight.see(stamp), ImageView::new(752, 480, &picture).unwrap());
            let time = Stamp::from_nanos(stamp.nanos());
            let count = if k < 300 {
                allocations(|| assert!(vio.points(time, &seen).is_ok()))
            } else if k < 450 {
                allocations(|| assert!(vio.image(time, &view).is_ok()))
            } else {
                allocations(|| assert!(vio.image_pair(time, &view, &view).is_ok()))
            };
            assert_eq!(count, 0, "image at sample {k}");
        }
    }
}

/// Neither for a sample, nor for a pose, however late, nor for an output.
#[test]
fn the_fusion_allocates_nothing() {
    let mut flight = Flight::new(1, 12.0);
    let start = flight.drawn_start(InitialSigma::default());
    let mut fusion = PoseFusion::new(flight.noise, &[PoseSource::default(); 2], FusionSettings::default()).unwrap();
    for (k, stamp) in flight.stamps().enumerate() {
        let sample = flight.imu(stamp);
        if k == 0 {
            fusion.imu(&sample).unwrap();
            fusion.initialize(&start).unwrap();
            continue;
        }
        assert_eq!(allocations(|| assert!(fusion.imu(&sample).is_ok())), 0, "sample {k}");
        assert_eq!(allocations(|| assert!(fusion.output().is_some())), 0, "output {k}");
        // Few poses, none for a while, more than the history holds; late ones and early ones.
        let due = match k {
            0..=800 => k % 10 == 0,
            801..=1400 => false,
            _ => k % 2 == 0,
        };
        if due && k > 100 {
            for (source, back) in [(0, 40), (1, 3 * (k % 5) as i64 - 1)] {
                let taken = Stamp::from_nanos((stamp.nanos() - 5_000_000 * back).min(flight.spline.span().1.nanos()));
                let pose = PoseMeasurement::isotropic(source, taken, flight.truth(taken).world_from_body, 0.01, 0.01);
                let count = allocations(|| {
                    let _ = fusion.pose(&pose);
                });
                assert_eq!(count, 0, "pose at sample {k}");
            }
        }
    }
    assert_eq!(fusion.diverged(), None);
}
