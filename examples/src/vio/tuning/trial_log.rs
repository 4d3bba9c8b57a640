//! `trials.csv`: every point that a search has tried, so that it can be gone on with.

use std::fs::File;
use std::io::Write as _;
use std::path::Path;

use vio_ekf::tune::{NoisePoint, Trial};

use crate::vio::error::{VioError, read_text};

/// Numbers are written so that they read back to the last bit.
fn line(point: &NoisePoint, cost: f64) -> String {
    let [a, b, c, d, e] = point;
    format!("{a},{b},{c},{d},{e},{cost}\n")
}

/// All of them, a line each.
pub(super) fn trials_text(trials: &[Trial]) -> String {
    trials.iter().map(|trial| line(&trial.point, trial.cost)).collect()
}

/// One more at the end of the file.
pub(super) fn append(log: &mut File, path: &Path, point: &NoisePoint, cost: f64) -> Result<(), VioError> {
    log.write_all(line(point, cost).as_bytes()).map_err(|error| VioError::unwritable(path, &error))
}

/// Those of a search that was cut off.
pub(super) fn read_trials(path: &Path) -> Result<Vec<Trial>, VioError> {
    let text = read_text(path)?;
    let mut trials = Vec::new();
    // A last line that was cut off is computed again.
    for (index, line) in text.split_inclusive('\n').filter(|line| line.ends_with('\n')).enumerate() {
        let numbers: Option<Vec<f64>> = line.trim().split(',').map(|field| field.parse().ok()).collect();
        match numbers.as_deref() {
            Some(&[a, b, c, d, e, cost]) => trials.push(Trial { point: [a, b, c, d, e], cost }),
            _ => return Err(VioError::malformed(path, &format!("line {}: expected six numbers", index + 1))),
        }
    }
    Ok(trials)
}
