//! The tables of an EuRoC/ASL folder: inertial samples, and which image was taken when.

use std::fmt::Write as _;

use nalgebra::Vector3;

use super::data_lines;
use crate::error::Error;
use crate::samples::Imu;
use crate::stamp::Stamp;

/// Reads `imu0/data.csv`: nanoseconds, angular rate (rad/s), specific force (m/s²). A line that repeats the stamp before
/// is dropped; stamps that go back are refused.
///
/// ```
/// let samples = vio_ekf::format::asl::read_imu("1403636579758555392,0.1,0,0,0,0,9.81\n")?;
/// assert_eq!((samples[0].gyro.x, samples[0].accel.z), (0.1, 9.81));
/// # Ok::<(), vio_ekf::Error>(())
/// ```
pub fn read_imu(text: &str) -> Result<Vec<Imu>, Error> {
    let mut samples: Vec<Imu> = Vec::new();
    for line in data_lines("ASL imu", text) {
        let fields: Vec<&str> = line.text.split(',').map(str::trim).collect();
        if fields.len() != 7 {
            return Err(line.error(format!("{} columns, expected 7 (t, gyro xyz, accel xyz)", fields.len())));
        }
        let mut v = [0.0; 7];
        for (column, field) in fields.iter().enumerate().skip(1) {
            v[column] = line.number(column, field)?;
        }
        let stamp = line.stamp(fields[0], 0)?;
        match samples.last() {
            Some(last) if stamp == last.stamp => continue,
            Some(last) if stamp < last.stamp => {
                return Err(line.error("its stamp is before that of the line before: sort the file".into()));
            }
            _ => {}
        }
        samples.push(Imu { stamp, gyro: Vector3::new(v[1], v[2], v[3]), accel: Vector3::new(v[4], v[5], v[6]) });
    }
    if samples.is_empty() {
        return Err(Error::TooFew { what: "samples in the ASL imu text", got: 0, need: 1 });
    }
    Ok(samples)
}

/// Writes `imu0/data.csv`.
pub fn write_imu(samples: &[Imu]) -> String {
    let mut text = String::from(
        "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],\
         a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n",
    );
    for Imu { stamp, gyro, accel } in samples {
        // Writing to a String cannot fail.
        let _ = write!(text, "{}", stamp.nanos());
        for value in gyro.iter().chain(accel) {
            let _ = write!(text, ",{value}");
        }
        text.push('\n');
    }
    text
}

/// Reads `cam0/data.csv`: nanoseconds and the name of a file in `cam0/data`, by rising stamps. Whether the files are
/// there is the caller's to see: public folders list images that were left out.
pub fn read_images(text: &str) -> Result<Vec<(Stamp, String)>, Error> {
    let mut images: Vec<(Stamp, String)> = Vec::new();
    for line in data_lines("ASL camera", text) {
        let (stamp, name) =
            line.text.split_once(',').ok_or_else(|| line.error("expected a stamp and a file name".into()))?;
        let stamp = line.stamp(stamp.trim(), 0)?;
        if images.last().is_some_and(|(last, _)| stamp <= *last) {
            return Err(line.error("its stamp is not after that of the line before: sort the file".into()));
        }
        images.push((stamp, name.trim().to_owned()));
    }
    if images.is_empty() {
        return Err(Error::TooFew { what: "images in the ASL camera text", got: 0, need: 1 });
    }
    Ok(images)
}

/// Writes `cam0/data.csv`.
pub fn write_images<'a>(images: impl IntoIterator<Item = (Stamp, &'a str)>) -> String {
    let mut text = String::from("#timestamp [ns],filename\n");
    for (stamp, name) in images {
        let _ = writeln!(text, "{},{name}", stamp.nanos());
    }
    text
}
