//! What a search for noise settings found, as files.

use std::f64::consts::LN_10;
use std::fmt::Write as _;
use std::path::Path;

use vio_ekf::tune::{Trial, with_factors};
use vio_ekf::{ImuNoise, Settings};

use super::data::TuningData;
use super::report::TuningReport;
use super::settings::{GROUPS, Tuning};
use crate::pictures::{Panel, save_curves};
use crate::report::save_figures;
use crate::vio::error::{VioError, write_file};

/// Writes `noise.yaml`, `settings.toml`, `tune.png`, `report.md` and `report.json`.
pub(super) fn save(
    report: &TuningReport,
    data: &TuningData,
    tuning: &Tuning,
    (trials, random): (&[Trial], &[Trial]),
    folder: &Path,
) -> Result<(), VioError> {
    // What is worse than the start would hide the rest.
    let better = |of: &[Trial]| best_so_far(of).into_iter().filter(|point| point.1 <= trials[0].cost / LN_10).collect();
    let mut curves = vec![("search", better(trials))];
    if !random.is_empty() {
        curves.push(("random points", better(random)));
    }
    let powers = |k: usize| trials.iter().enumerate().map(|(i, t)| (i as f64 + 1.0, t.point[k])).collect();
    let panels = [
        Panel { label: "best so far [log10 m]", curves },
        Panel { label: "inertial [powers of 10]", curves: (0..4).map(|k| (GROUPS[k], powers(k))).collect() },
        Panel { label: "image [powers of 10]", curves: vec![(GROUPS[4], powers(4))] },
    ];
    save_curves(&folder.join("tune.png"), "Search for noise settings", "evaluation", &panels)?;
    let base = match data {
        TuningData::Points(_) => (ImuNoise::default(), 200.0),
        TuningData::Recordings(recordings) => (recordings[0].imu.noise, recordings[0].imu.rate_hz),
    };
    let best = [
        report.factor_gyro_white,
        report.factor_gyro_walk,
        report.factor_accel_white,
        report.factor_accel_walk,
        report.factor_image,
    ];
    let (noise, settings) = with_factors(&base.0, &Settings::default(), &best.map(f64::log10));
    let yaml = format!(
        "imu0:\n  gyroscope_noise_density: {:e}\n  gyroscope_random_walk: {:e}\n  accelerometer_noise_density: {:e}\n  \
         accelerometer_random_walk: {:e}\n  update_rate: {}\n",
        noise.gyro_density, noise.gyro_walk, noise.accel_density, noise.accel_walk, base.1
    );
    write_file(&folder.join("noise.yaml"), yaml.as_bytes())?;
    let path = folder.join("settings.toml");
    let text = toml::to_string(&settings).map_err(|error| VioError::unwritable(&path, &error))?;
    write_file(&path, text.as_bytes())?;
    write_file(&folder.join("report.md"), markdown(report, tuning, best, &settings).as_bytes())?;
    save_figures(report, folder)?;
    Ok(())
}

fn markdown(report: &TuningReport, tuning: &Tuning, best: [f64; 5], settings: &Settings) -> String {
    let mut text = format!(
        "# Noise settings from {} recordings\n\n{} evaluations in {:.0} s on {} threads. Version {}.\n\n![Search](tune.png)\n\n\
         | noise | start | found |\n|---|---|---|\n",
        report.recordings, report.evaluations, report.search_wall_s, report.threads, report.version
    );
    for ((name, power), factor) in GROUPS.iter().zip(tuning.start).zip(best) {
        let _ = writeln!(text, "| {name}, factor | {:.3} | {factor:.3} |", 10_f64.powf(power));
    }
    let mut row = |name: &str, start: f64, found: f64| {
        let _ = writeln!(text, "| {name} | {start:.4} | {found:.4} |");
    };
    row("position error, geometric mean [m]", report.ate_start_m, report.ate_best_m);
    row("NEES, mean (3 is consistent)", report.nees_start, report.nees_best);
    row("error weighted by inconsistency [m]", report.weighted_error_start_m, report.weighted_error_best_m);
    if let (Some(error), Some(ratio)) = (report.weighted_error_random_m, report.ratio_to_random) {
        let _ = writeln!(
            text,
            "\nThe best of {} points drawn at random inside the same bounds: {error:.4} m; the search reaches {ratio:.3} of it.",
            report.random_samples
        );
    }
    let weighted = report.held_out_error_data_sheet_m.zip(report.held_out_error_tuned_m);
    let position = report.held_out_ate_data_sheet_m.zip(report.held_out_ate_tuned_m);
    if let Some(((given, tuned), (given_ate, tuned_ate))) = weighted.zip(position) {
        let kept =
            if report.data_sheet_kept { " That is no gain: the noise of the data sheet is handed on." } else { "" };
        let _ = writeln!(
            text,
            "\nOn recordings that were left out, one after the other: {given:.4} m with the noise of the data sheet, {tuned:.4} m with \
             that which is best for the others; positions alone {given_ate:.4} and {tuned_ate:.4} m.{kept}"
        );
    }
    let (patches, landmarks) = (&settings.patches, &settings.landmarks);
    let _ = writeln!(
        text,
        "\nThe inertial noise is in [noise.yaml](noise.yaml), for `vio --imu`, that of images in [settings.toml](settings.toml), for \
         `vio --settings`: `intensity_sigma` {:.3}, `pixel_sigma` {:.4} of patches and {:.4} of landmarks. Every point tried is in [trials.csv](trials.csv), all figures in \
         [report.json](report.json).",
        patches.intensity_sigma, patches.pixel_sigma, landmarks.pixel_sigma
    );
    text
}

fn best_so_far(trials: &[Trial]) -> Vec<(f64, f64)> {
    let mut least = f64::INFINITY;
    let mut lower = |(index, trial): (usize, &Trial)| {
        least = least.min(trial.cost);
        (index as f64 + 1.0, least / LN_10)
    };
    trials.iter().enumerate().map(&mut lower).collect()
}
