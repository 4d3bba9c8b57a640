//! What a subscriber hears: the steps of an image, and what is refused. A program of its own: tests beside it that have no subscriber
//! would take part in what `tracing` remembers about who listens.
#![cfg(feature = "tracing")]
#![allow(clippy::unwrap_used, reason = "a test may panic, in its helpers too")]

use std::fmt::Write as _;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use tracing::field::{Field, Visit};
use tracing::span::{Attributes, Id, Record};
use tracing::{Event, Metadata, Subscriber};
use vio_ekf::inertial::{InitialSigma, InitialState};
use vio_ekf::nalgebra::{Isometry3, Vector3};
use vio_ekf::{Camera, ImageView, Imu, ImuNoise, Settings, Stamp, Vio};

/// Writes the names of spans and the texts of events, one a line.
struct Listener {
    heard: Arc<Mutex<String>>,
    next: AtomicU64,
}

struct Text<'a>(&'a mut String);

impl Visit for Text<'_> {
    fn record_debug(&mut self, field: &Field, value: &dyn std::fmt::Debug) {
        write!(self.0, " {}={value:?}", field.name()).unwrap();
    }
}

impl Subscriber for Listener {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        metadata.target().starts_with("vio_ekf")
    }

    fn new_span(&self, span: &Attributes<'_>) -> Id {
        writeln!(self.heard.lock().unwrap(), "span {}", span.metadata().name()).unwrap();
        Id::from_u64(self.next.fetch_add(1, Ordering::Relaxed))
    }

    fn event(&self, event: &Event<'_>) {
        let mut heard = self.heard.lock().unwrap();
        write!(heard, "{}", event.metadata().level()).unwrap();
        event.record(&mut Text(&mut heard));
        heard.push('\n');
    }

    fn record(&self, _: &Id, _: &Record<'_>) {}
    fn record_follows_from(&self, _: &Id, _: &Id) {}
    fn enter(&self, _: &Id) {}
    fn exit(&self, _: &Id) {}
}

#[test]
fn steps_and_refusals_are_heard() {
    let heard = Arc::new(Mutex::new(String::new()));
    let listener = Listener { heard: Arc::clone(&heard), next: AtomicU64::new(1) };
    tracing::subscriber::with_default(listener, || {
        let mut vio = Vio::new(Camera::euroc(), ImuNoise::default(), Settings::default()).unwrap();
        let at = |millis: i64| Stamp::from_nanos(millis * 1_000_000);
        let imu = |millis| Imu { stamp: at(millis), gyro: Vector3::zeros(), accel: Vector3::new(0.0, 0.0, 9.81) };
        vio.imu(&imu(0)).unwrap();
        assert!(vio.imu(&imu(0)).is_err());
        vio.initialize(&InitialState {
            stamp: at(0),
            world_from_body: Isometry3::identity(),
            velocity_in_body: Vector3::zeros(),
            gyro_bias: Vector3::zeros(),
            accel_bias: Vector3::zeros(),
            sigma: InitialSigma::default(),
        })
        .unwrap();
        let bright = |k: usize| k % 752 % 60 < 30 && k / 752 % 60 < 30;
        let picture: Vec<u8> = (0..752 * 480).map(|k| if bright(k) { 180 } else { 60 }).collect();
        let view = ImageView::new(752, 480, &picture).unwrap();
        for k in 1..=20 {
            vio.imu(&imu(5 * k)).unwrap();
            if k % 10 == 0 {
                vio.image(at(5 * k), &view).unwrap();
            }
        }
        assert!(vio.image(at(20), &view).is_err());
    });
    let heard = heard.lock().unwrap();
    for words in [
        "WARN message=inertial sample refused error=",
        "INFO message=initialised",
        "span image",
        "span propagate",
        "span align_and_update",
        "span detect_landmarks",
        "message=image done",
        "message=image refused: it is too late",
    ] {
        assert!(heard.contains(words), "`{words}` is not in:\n{heard}");
    }
}
