//! The keys that calibration files hold, as serde reads them. All are optional here: what is missing is named by the reader,
//! by the key that its format uses.

use std::fmt;

use serde::Deserialize;
use serde::de::{DeserializeOwned, Deserializer, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde_saphyr::{MessageFormatter as _, Spanned, UserMessageFormatter};

use crate::error::Error;

/// Of the errors.
pub(super) const FORMAT: &str = "calibration";

/// A value with the line where it stands, if the file has it.
pub(super) type Field<T> = Option<Spanned<T>>;

/// A camera of either format.
#[derive(Deserialize)]
pub(super) struct CameraSection {
    #[serde(rename = "T_BS")]
    pub(super) body_from_sensor: Option<OpenCvMatrix>,
    #[serde(rename = "T_cam_imu")]
    pub(super) camera_from_imu: Field<Numbers>,
    #[serde(rename = "T_imu_cam")]
    pub(super) imu_from_camera: Field<Numbers>,
    pub(super) camera_model: Field<String>,
    pub(super) resolution: Field<Numbers>,
    pub(super) intrinsics: Field<Numbers>,
    pub(super) distortion_model: Field<String>,
    /// EuRoC's name and Kalibr's.
    #[serde(alias = "distortion_coeffs")]
    pub(super) distortion_coefficients: Field<Numbers>,
    pub(super) rate_hz: Field<Numbers>,
    pub(super) timeshift_cam_imu: Field<Numbers>,
    pub(super) line_delay: Field<Numbers>,
}

/// An inertial sensor of either format.
#[derive(Deserialize)]
pub(super) struct ImuSection {
    #[serde(rename = "T_BS")]
    pub(super) body_from_sensor: Option<OpenCvMatrix>,
    #[serde(rename = "T_i_b")]
    pub(super) imu_from_body: Field<Numbers>,
    pub(super) rate_hz: Field<Numbers>,
    pub(super) update_rate: Field<Numbers>,
    pub(super) gyroscope_noise_density: Field<Numbers>,
    pub(super) gyroscope_random_walk: Field<Numbers>,
    pub(super) accelerometer_noise_density: Field<Numbers>,
    pub(super) accelerometer_random_walk: Field<Numbers>,
}

/// A matrix as `OpenCV` writes it; `rows` and `cols` are known.
#[derive(Deserialize)]
pub(super) struct OpenCvMatrix {
    pub(super) data: Field<Numbers>,
}

/// The inertial chain of Kalibr: one sensor is read.
#[derive(Deserialize)]
pub(super) struct ImuChain {
    pub(super) imu0: Field<ImuSection>,
    /// There only in the wrong file.
    pub(super) cam0: Field<IgnoredAny>,
}

/// The sections of a Kalibr chain whose names begin with `cam`, in the order of the file, and the other keys.
pub(super) struct CameraChain {
    pub(super) cameras: Vec<(String, Spanned<CameraSection>)>,
    pub(super) others: Vec<String>,
}

impl<'de> Deserialize<'de> for CameraChain {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Sections;

        impl<'de> Visitor<'de> for Sections {
            type Value = CameraChain;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("sections `cam0:`, `cam1:` ...")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<CameraChain, A::Error> {
                let (mut cameras, mut others) = (Vec::new(), Vec::new());
                while let Some(name) = map.next_key::<String>()? {
                    // `camera_model` and the like are keys of a section, not sections.
                    if name.strip_prefix("cam").is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit())) {
                        cameras.push((name, map.next_value()?));
                    } else {
                        map.next_value::<IgnoredAny>()?;
                        others.push(name);
                    }
                }
                Ok(CameraChain { cameras, others })
            }
        }

        deserializer.deserialize_map(Sections)
    }
}

/// A number, a list, or a list of rows, in the order of the file; or the first word in it that is no finite number.
pub(super) struct Numbers(pub(super) Result<Vec<f64>, String>);

impl<'de> Deserialize<'de> for Numbers {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Flat;

        impl<'de> Visitor<'de> for Flat {
            type Value = Numbers;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("numbers")
            }

            fn visit_f64<E>(self, value: f64) -> Result<Numbers, E> {
                Ok(Numbers(if value.is_finite() { Ok(vec![value]) } else { Err(value.to_string()) }))
            }

            fn visit_i64<E: serde::de::Error>(self, value: i64) -> Result<Numbers, E> {
                self.visit_f64(value as f64)
            }

            fn visit_u64<E: serde::de::Error>(self, value: u64) -> Result<Numbers, E> {
                self.visit_f64(value as f64)
            }

            /// In quotes, or as YAML does not write numbers (`1e-3` without a point).
            fn visit_str<E: serde::de::Error>(self, word: &str) -> Result<Numbers, E> {
                match word.parse::<f64>() {
                    Ok(value) if value.is_finite() => self.visit_f64(value),
                    _ => Ok(Numbers(Err(word.to_owned()))),
                }
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Numbers, A::Error> {
                let mut all = Ok(Vec::new());
                while let Some(Numbers(part)) = list.next_element()? {
                    match (&mut all, part) {
                        (Ok(all), Ok(part)) => all.extend(part),
                        (Ok(_), Err(word)) => all = Err(word),
                        (Err(_), _) => (),
                    }
                }
                Ok(Numbers(all))
            }
        }

        deserializer.deserialize_any(Flat)
    }
}

/// Reads a text without the lines that begin with `%`: the header of `OpenCV`, `%YAML:1.0`, is not YAML.
pub(super) fn parse<T: DeserializeOwned>(text: &str) -> Result<T, Error> {
    let lines = text.trim_start_matches('\u{feff}').lines();
    let yaml: String = lines.flat_map(|line| [if line.starts_with('%') { "" } else { line }, "\n"]).collect();
    serde_saphyr::from_str(&yaml).map_err(|error| {
        let line = error.location().map_or(0, |at| at.line() as usize);
        let what = UserMessageFormatter.format_message(error.without_snippet());
        Error::Line {
            format: FORMAT,
            line,
            what: format!("{what}: give YAML as EuRoC's `sensor.yaml` or Kalibr has it"),
        }
    })
}
