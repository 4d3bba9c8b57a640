//! The frames of a simulated camera, rendered or from an earlier run.

use std::io;
use std::path::PathBuf;

use vio_ekf::sim::{Frame, Simulation};
use vio_ekf::{Camera, ImageView, Stamp};

/// Bytes before the pixels of a file: the stamp and the true stamp, nanoseconds.
const HEAD: usize = 16;

/// One camera of a simulation and, maybe, a folder that keeps its frames, one file each.
pub struct Frames<'a> {
    simulation: &'a Simulation,
    which: usize,
    camera: Camera,
    folder: Option<PathBuf>,
}

impl<'a> Frames<'a> {
    /// Of camera `which`, which must be this `camera`. The folder is made; it must be this camera's alone.
    ///
    /// # Errors
    /// If the folder cannot be made.
    pub fn new(
        simulation: &'a Simulation,
        which: usize,
        camera: Camera,
        folder: Option<PathBuf>,
    ) -> Result<Self, io::Error> {
        if let Some(folder) = &folder {
            std::fs::create_dir_all(folder)?;
        }
        Ok(Self { simulation, which, camera, folder })
    }

    /// How many there are, lost ones included.
    pub fn count(&self) -> usize {
        self.simulation.frame_count(self.which)
    }

    /// Frame `index`; `None` if the camera lost it.
    ///
    /// # Errors
    /// If it cannot be rendered, or a file be read or written.
    pub fn get(&self, index: usize) -> Result<Option<Frame>, Box<dyn std::error::Error>> {
        let Some(folder) = &self.folder else { return Ok(self.simulation.frame(self.which, index)?) };
        let file = folder.join(index.to_string());
        if let Ok(bytes) = std::fs::read(&file) {
            let (head, data) = bytes.split_at_checked(HEAD).ok_or("a file of the cache is cut off")?;
            let stamps: [i64; 2] = [0, 8].map(|k| i64::from_le_bytes(head[k..k + 8].try_into().unwrap_or_default()));
            let [stamp, true_stamp] = stamps.map(Stamp::from_nanos);
            let Camera { width, height, .. } = self.camera;
            ImageView::new(width, height, data)?;
            return Ok(Some(Frame { stamp, true_stamp, width, height, data: data.to_vec() }));
        }
        let Some(frame) = self.simulation.frame(self.which, index)? else { return Ok(None) };
        let mut bytes = frame.stamp.nanos().to_le_bytes().to_vec();
        bytes.extend(frame.true_stamp.nanos().to_le_bytes());
        bytes.extend(&frame.data);
        // Renamed when whole: another run may be reading.
        let partial = folder.join(format!("{index}.{}", std::process::id()));
        std::fs::write(&partial, bytes)?;
        std::fs::rename(partial, file)?;
        Ok(Some(frame))
    }
}
