//! Sprays from photographed bursts and paints from layer charts, on data that `calibration_peers.py` solves as well.

use std::error::Error;
use std::path::Path;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector3};
use paint_sim::colour::{BANDS, Spectrum, spectrum_linear_srgb};
use paint_sim::paint::Patch;
use paint_sim::spray::calibration::{Burst, CalibrationSettings, Coating, Response, calibrate};
use paint_sim::{Paint, SprayModel, Substrate, km};
use serde_json::json;

use crate::Rng;
use crate::cpu::median_seconds;

type AnyError = Box<dyn Error>;

/// Readings in a row and in a column of a card, and their distance, metres.
const COLUMNS: usize = 81;
const PIXEL: f64 = 1.5e-3;
/// Paint per second, m^3/s.
const FLOW: f64 = 10e-9;
/// Deviation of a reading of a burst, and of a patch of 20 by 20 readings with half a per cent each.
const NOISE: [f64; 2] = [0.01, 0.005 / 20.0];
/// Layers of the chart's patches, and the thickness of one, metres.
const LAYERS: [f64; 5] = [1.0, 2.0, 4.0, 8.0, 16.0];
const LAYER: f64 = 8e-6;
/// Where the peer starts: the truth of its coordinates is off by 10 to 30 %.
const OFF: [f64; 6] = [0.2, 0.3, 0.1, 0.2, 0.02, -0.02];

/// Writes bursts and a chart into a folder as JSON, solves both, and prints times and results.
///
/// # Errors
/// A folder that cannot be written.
pub fn run(folder: &Path, runs: usize) -> Result<(), AnyError> {
    std::fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    spray(folder, runs)?;
    chart(folder, runs)
}

fn write(path: &Path, value: &serde_json::Value) -> Result<(), AnyError> {
    std::fs::write(path, value.to_string()).map_err(|e| format!("{}: {e}", path.display()).into())
}

fn spray(folder: &Path, runs: usize) -> Result<(), AnyError> {
    let truth = SprayModel {
        sigma: 8.0_f64.to_radians(),
        cut: 5.0,
        aspect: 1.4,
        turn: 0.4,
        yaw: 0.02,
        pitch: -0.01,
        ..SprayModel::default()
    };
    let coating = Coating { paint: Paint::blue(8e-6)?, card: Substrate::grey(0.85)?, response: Response::LinearSrgb };
    let mut rng = Rng::new(6);
    let tilted = [[0.0, 0.0], [0.4, 0.0], [0.0, -0.5], [0.0, 0.0], [-0.3, 0.3]];
    let mut bursts = Vec::new();
    for (distance, tilt) in [0.06, 0.08, 0.10, 0.12, 0.15].into_iter().zip(tilted) {
        let facing = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), -std::f64::consts::FRAC_PI_2);
        let before = Isometry3::from_parts(Translation3::new(0.0, 0.0, -distance), facing);
        let card_from_nozzle = Isometry3::rotation(Vector3::new(tilt[0], tilt[1], 0.0)) * before;
        let duration = 100.0 * distance * distance;
        let mut readings = Vec::with_capacity(3 * COLUMNS * COLUMNS);
        for k in 0..COLUMNS * COLUMNS {
            let at = |k: usize| k as f64 - 0.5 * (COLUMNS - 1) as f64;
            let place = Point3::new(at(k % COLUMNS), at(k / COLUMNS), 0.0) * PIXEL;
            let thickness = FLOW * duration * truth.density_from(&card_from_nozzle, &place, &-Vector3::z_axis());
            let seen = spectrum_linear_srgb(coating.paint.over(thickness, &coating.card)?.reflectance());
            readings.extend(seen.map(|value| value + NOISE[0] * rng.normal()));
        }
        bursts.push(Burst { card_from_nozzle, duration, columns: COLUMNS, pixel: PIXEL, readings });
    }
    let alone = |band: usize| -> Spectrum { std::array::from_fn(|k| f64::from(u8::from(k == band))) };
    let shares: Vec<[f64; 3]> = (0..BANDS).map(|band| spectrum_linear_srgb(&alone(band))).collect();
    let weights = [0, 1, 2].map(|channel| shares.iter().map(|share| share[channel]).collect::<Vec<_>>());
    let start = [truth.sigma.tan().ln(), FLOW.ln(), truth.aspect.ln(), truth.turn, truth.yaw.tan(), truth.pitch.tan()];
    let told = |burst: &Burst| {
        let rotation = burst.card_from_nozzle.rotation.to_rotation_matrix();
        let rows = [0, 1, 2].map(|row| [0, 1, 2].map(|column| rotation[(row, column)]));
        let tip = burst.card_from_nozzle.translation.vector;
        json!({
            "rotation": rows, "translation": [tip.x, tip.y, tip.z], "duration": burst.duration, "columns": burst.columns,
            "pixel": burst.pixel, "readings": burst.readings,
        })
    };
    write(
        &folder.join("bursts.json"),
        &json!({
            "absorption": coating.paint.absorption().to_vec(), "scattering": coating.paint.scattering().to_vec(),
            "card": coating.card.reflectance().to_vec(), "weights": weights, "cut": truth.cut, "noise": NOISE[0],
            "start": std::array::from_fn::<f64, 6, _>(|k| start[k] + OFF[k]).to_vec(),
            "bursts": bursts.iter().map(told).collect::<Vec<_>>(),
        }),
    )?;
    let settings = CalibrationSettings { noise: NOISE[0], ..CalibrationSettings::default() };
    let found = calibrate(&bursts, Some(&coating), &settings)?;
    let seconds = median_seconds(runs, || calibrate(&bursts, Some(&coating), &settings));
    println!(
        "{}",
        json!({
            "fig": "spray_calibration", "peer": "paint-sim", "runs": runs.max(1), "cpu_ms": 1e3 * seconds,
            "sigma": found.spray.sigma, "flow": found.flow, "cost": found.chi_square,
            "sigma_error": found.spray.sigma / truth.sigma - 1.0, "flow_error": found.flow / FLOW - 1.0,
            "steps": found.iterations, "agrees": found.agrees(),
        })
    );
    Ok(())
}

fn chart(folder: &Path, runs: usize) -> Result<(), AnyError> {
    let mut rng = Rng::new(7);
    let part = |band: usize| band as f64 / (BANDS - 1) as f64;
    let absorption: Spectrum = std::array::from_fn(|band| 0.02 + 0.4 * part(band) * part(band));
    let scattering: Spectrum = std::array::from_fn(|band| 0.1 + 0.25 * (1.0 - part(band)));
    let ground: Spectrum = std::array::from_fn(|band| 0.75 + 0.1 * (band as f64).sin());
    let patches = LAYERS.map(|layers| {
        let read = |band: usize| km::reflectance(absorption[band], scattering[band], layers, ground[band]);
        let reflectance = std::array::from_fn(|band| read(band) + NOISE[1] * rng.normal());
        Patch { thickness: LAYER * layers, reflectance, noise: NOISE[1] }
    });
    let readings = patches.map(|patch| patch.reflectance.to_vec());
    write(
        &folder.join("chart.json"),
        &json!({ "layers": LAYERS, "ground": ground.to_vec(), "reflectance": readings, "noise": NOISE[1] }),
    )?;
    let ground = Substrate::new(ground)?;
    let fit = Paint::from_chart(&ground, &patches)?;
    let seconds = median_seconds(runs, || Paint::from_chart(&ground, &patches));
    let sum = |spectrum: &Spectrum| LAYER * spectrum.iter().sum::<f64>();
    // Three deviations are one per cent.
    let determined: Vec<usize> = (0..BANDS).filter(|&band| fit.determines(band, 0.01 / 3.0)).collect();
    let off = |band: usize| {
        let found = [fit.paint.absorption(), fit.paint.scattering()].map(|s| LAYER * s[band]);
        (found[0] / absorption[band] - 1.0).abs().max((found[1] / scattering[band] - 1.0).abs())
    };
    let worst = determined.iter().map(|&band| off(band)).fold(0.0, f64::max);
    println!(
        "{}",
        json!({
            "fig": "layer_chart", "peer": "paint-sim", "runs": runs.max(1), "cpu_ms": 1e3 * seconds,
            "absorption_sum": sum(fit.paint.absorption()), "scattering_sum": sum(fit.paint.scattering()),
            "bands_determined": determined.len(), "worst_error_there": worst, "agrees": fit.agrees(),
        })
    );
    Ok(())
}
