//! A plan in pieces that a tank and a battery last for.

use crate::error::{Error, ensure};

/// Step at which the flow is looked at, s: pieces end at multiples of it.
const STEP: f64 = 0.05;
/// A piece ends where the valve is shut if that is in its last so much; otherwise where it must.
const LATE: f64 = 0.5;
/// Shortest piece, s.
const SHORTEST: f64 = 5.0;

/// How long a robot lasts. What is `None` comes through its tether.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct Endurance {
    /// Paint in the tank, m³.
    pub tank: Option<f64>,
    /// Time in the air on a battery, s.
    pub battery: Option<f64>,
    /// What of it a sortie takes beside its piece of the plan, s: take-off, finding its place, the ways there and back, landing. Default 40.
    pub overhead: f64,
}

impl Default for Endurance {
    fn default() -> Self {
        Self { tank: None, battery: None, overhead: 40.0 }
    }
}

impl Endurance {
    /// Whether there is nothing that ends: on a tether.
    pub fn is_endless(&self) -> bool {
        self.tank.is_none() && self.battery.is_none()
    }
}

/// A piece of a plan.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sortie {
    /// Where it begins and ends, s of the plan.
    pub from: f64,
    /// As above; the next begins there.
    pub until: f64,
    /// Paint that it takes, m³.
    pub paint: f64,
}

/// Cuts a plan of a `duration` (s) with a `flow` (m³/s at a time) into pieces, where the valve is shut if it can be.
///
/// # Errors
/// Numbers out of range; a tank or a battery that lasts for less than 5 s of the plan.
pub fn sorties(duration: f64, flow: &dyn Fn(f64) -> f64, endurance: &Endurance) -> Result<Vec<Sortie>, Error> {
    let Endurance { tank, battery, overhead } = *endurance;
    ensure("endurance.overhead", overhead, overhead >= 0.0 && overhead.is_finite(), "at least 0 s")?;
    let tank = tank.unwrap_or(f64::INFINITY);
    ensure("endurance.tank", tank, tank > 0.0, "positive")?;
    let time = battery.map_or(f64::INFINITY, |battery| battery - overhead);
    let lasts = battery.is_none() || time >= SHORTEST;
    ensure("endurance.battery", battery.unwrap_or(0.0), lasts, "5 s longer than the ways there and back")?;
    let last = (duration / STEP).ceil() as usize;
    let at = |step: usize| (STEP * step as f64).min(duration);
    let (mut pieces, mut first, mut paint) = (Vec::new(), 0, 0.0);
    // The last step before which the valve was shut, with the paint until there.
    let mut shut = (0, 0.0);
    let mut step = 0;
    while step < last {
        let given = flow(at(step) + 0.5 * STEP).max(0.0) * (at(step + 1) - at(step));
        if given == 0.0 {
            shut = (step, paint);
        }
        if paint + given > tank || at(step + 1) - at(first) > time {
            let late = shut.0 as f64 >= first as f64 + (1.0 - LATE) * (step - first) as f64;
            let (end, taken) = if late { shut } else { (step, paint) };
            ensure("endurance.tank", tank, at(end) - at(first) >= SHORTEST, "enough for 5 s of the plan")?;
            pieces.push(Sortie { from: at(first), until: at(end), paint: taken });
            (first, step, paint) = (end, end, 0.0);
            shut = (end, 0.0);
        } else {
            paint += given;
            step += 1;
        }
    }
    pieces.push(Sortie { from: at(first), until: duration, paint });
    Ok(pieces)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ten seconds of 1 cm³/s, two without, again and again.
    fn strokes(t: f64) -> f64 {
        if t.rem_euclid(12.0) < 10.0 { 1e-6 } else { 0.0 }
    }

    #[test]
    fn pieces_join_and_keep_within_tank_and_battery() {
        for (tank, battery) in [(Some(3.3e-5), None), (None, Some(100.0)), (Some(2.5e-5), Some(75.0)), (None, None)] {
            let endurance = Endurance { tank, battery, ..Endurance::default() };
            let pieces = sorties(233.0, &strokes, &endurance).unwrap();
            assert_eq!((pieces[0].from, pieces[pieces.len() - 1].until), (0.0, 233.0));
            assert!(pieces.windows(2).all(|pair| pair[0].until == pair[1].from));
            for piece in &pieces {
                assert!(tank.is_none_or(|tank| piece.paint <= tank + 1e-12), "{piece:?}");
                assert!(battery.is_none_or(|battery| piece.until - piece.from <= battery - 40.0 + 1e-9), "{piece:?}");
            }
            // 19 whole strokes and 5 s of the next.
            let all: f64 = pieces.iter().map(|piece| piece.paint).sum();
            assert!((all - 1.95e-4).abs() < 1e-9, "{all}");
            // They end where the valve is shut.
            assert!(
                pieces[..pieces.len() - 1]
                    .iter()
                    .all(|piece| strokes(piece.until + 0.01) == 0.0 || strokes(piece.until - 0.01) == 0.0)
            );
            assert_eq!(pieces.len() == 1, endurance.is_endless());
        }
        // Three strokes of a tank that holds three and a third.
        let tank = Endurance { tank: Some(3.3e-5), ..Endurance::default() };
        assert!((sorties(233.0, &strokes, &tank).unwrap()[0].paint - 3e-5).abs() < 1e-12);
    }

    /// Painted without a pause it ends where it must.
    #[test]
    fn without_a_pause_the_tank_is_used_up() {
        // Half a step's paint less than 20 s take.
        let tank = Endurance { tank: Some(1.9975e-5), ..Endurance::default() };
        let pieces = sorties(50.0, &|_| 1e-6, &tank).unwrap();
        let ends: Vec<f64> = pieces.iter().map(|piece| piece.until).collect();
        assert_eq!(pieces.len(), 3);
        assert!(pieces.iter().all(|piece| piece.paint <= 1.9975e-5), "{pieces:?}");
        assert!((ends[0] - 20.0).abs() < 0.06 && (ends[1] - 40.0).abs() < 0.11 && ends[2] == 50.0, "{ends:?}");
    }

    #[test]
    fn what_lasts_for_nothing_is_refused() {
        let usual = Endurance::default();
        for bad in [
            Endurance { tank: Some(0.0), ..usual },
            Endurance { tank: Some(f64::NAN), ..usual },
            Endurance { tank: Some(1e-6), ..usual },
            Endurance { battery: Some(44.0), ..usual },
            Endurance { overhead: -1.0, ..usual },
        ] {
            assert!(matches!(sorties(60.0, &|_| 1e-6, &bad), Err(Error::Setting { .. })), "{bad:?}");
        }
    }
}
