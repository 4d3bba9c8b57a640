//! The air before a wall, in which spray drifts.

use nalgebra::Vector3;
use paint_sim::spray::air::{Air, DropletSettings};
use serde::{Deserialize, Serialize};

/// Wind past a wall, the same everywhere, and the spray that it carries along.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MovingAir {
    /// Mean velocity in the world, m/s. Default 0. What of it goes into the wall is left out.
    pub wind: [f64; 3],
    /// Standard deviation of its fluctuations per axis, m/s. Default 0.
    pub turbulence: f64,
    /// Droplets of the nozzle.
    pub droplets: DropletSettings,
}

impl MovingAir {
    /// As the simulation takes it.
    pub fn air(&self) -> Air {
        Air { velocity: Vector3::from(self.wind), turbulence: self.turbulence }
    }
}

/// Reads `X,Y,Z` or `X,Y,Z,TURBULENCE`, m/s.
///
/// # Errors
/// Anything else.
pub fn parse_wind(text: &str) -> Result<MovingAir, String> {
    let values: Option<Vec<f64>> =
        text.split(',').map(|part| part.trim().parse().ok().filter(|v: &f64| v.is_finite())).collect();
    let air = |wind, turbulence| MovingAir { wind, turbulence, ..MovingAir::default() };
    match values.as_deref() {
        Some(&[x, y, z]) => Ok(air([x, y, z], 0.0)),
        Some(&[x, y, z, turbulence]) if turbulence >= 0.0 => Ok(air([x, y, z], turbulence)),
        _ => Err("give X,Y,Z in m/s, and perhaps the deviation of its fluctuations: 0,2,0 or 0,2,0,0.5".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wind_is_three_numbers_or_four() {
        assert_eq!(parse_wind("0, -2,0.5").unwrap().wind, [0.0, -2.0, 0.5]);
        assert_eq!(parse_wind("1,0,0,0.4").unwrap().turbulence, 0.4);
        for text in ["", "1,2", "1,2,3,4,5", "1,2,x", "1,2,3,-1", "nan,0,0"] {
            assert!(parse_wind(text).is_err(), "{text}");
        }
    }
}
