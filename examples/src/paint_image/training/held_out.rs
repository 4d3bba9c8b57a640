//! How the thesis' network paints pictures that it was not trained on.

use paint_net::thesis::{Network, Step};
use paint_net::{Error, Image, metrics};

use super::rollout::stamp;
use crate::pictures::Rgb;

/// Pictures painted at once.
const TOGETHER: usize = 50;
/// Pictures, and pixels for each of their sprays, in the picture of the volumes.
const SHOWN: usize = 100;
const ENLARGED: u32 = 4;

/// Means over pictures.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Painted {
    pub(super) bce_nats_per_px: f64,
    pub(super) psnr_db: f64,
    pub(super) steps_mean: f64,
    /// Share of the sprayed volume that lands where the ink had reached what is wanted.
    pub(super) over_share: f64,
}

impl Painted {
    /// As the network paints without noise.
    pub(super) fn by(network: &Network, pictures: &[Image]) -> Result<Self, Error> {
        let [mut cross_entropy, mut psnr, mut steps_taken, mut sprayed, mut over] = [0.0; 5];
        for (picture, steps) in painted(network, pictures)? {
            let mut canvas = picture.map(|_| 0.0);
            for step in &steps {
                sprayed += step.volume;
                over += step.volume * f64::from(u8::from(is_done(&canvas, picture, step)));
                stamp(step, &mut canvas)?;
            }
            let ink = canvas.map(f64::tanh);
            cross_entropy += metrics::binary_cross_entropy(&ink, picture)?;
            // An empty picture that stays empty would count 200 dB.
            psnr += metrics::psnr(&ink, picture, None)?.min(60.0);
            steps_taken += steps.len() as f64;
        }
        let count = pictures.len() as f64;
        Ok(Self {
            bce_nats_per_px: cross_entropy / count,
            psnr_db: psnr / count,
            steps_mean: steps_taken / count,
            over_share: if sprayed > 0.0 { over / sprayed } else { 0.0 },
        })
    }
}

/// Whether a spray's place needs no more ink; one beside the picture never did.
fn is_done(canvas: &Image, wanted: &Image, step: &Step) -> bool {
    let nearest =
        |at: f64, extent: usize| (at > -0.5 && at < extent as f64 - 0.5).then(|| at.round().max(0.0) as usize);
    let (x, y) = step.position;
    match (nearest(x, wanted.width()), nearest(y, wanted.height())) {
        (Some(x), Some(y)) => canvas.at(x, y).tanh() >= wanted.at(x, y),
        _ => true,
    }
}

/// Volumes over time as in the thesis' Fig. 8.7: a row for each of up to a hundred pictures, a column for each step, the largest volume white.
pub(super) fn volume_picture(network: &Network, pictures: &[Image]) -> Result<Rgb, Error> {
    let rows = painted(network, &pictures[..SHOWN.min(pictures.len())])?;
    let most = rows.iter().flat_map(|(_, steps)| steps).map(|step| step.volume).fold(0.0, f64::max);
    let columns = network.architecture().steps;
    let level =
        |step: Option<&Step>| [(255.0 * step.map_or(0.0, |step| step.volume) / most.max(1e-12)).round() as u8; 3];
    let pixels = rows.iter().flat_map(|(_, steps)| (0..columns).map(|t| level(steps.get(t))));
    Ok(Rgb::from_pixels(columns, rows.len(), pixels).enlarged(ENLARGED))
}

/// Every picture with the steps that paint it.
fn painted<'a>(network: &Network, pictures: &'a [Image]) -> Result<Vec<(&'a Image, Vec<Step>)>, Error> {
    let mut all = Vec::with_capacity(pictures.len());
    for some in pictures.chunks(TOGETHER) {
        let tasks: Vec<(Image, Option<Image>)> = some.iter().map(|p| (p.clone(), None)).collect();
        all.extend(some.iter().zip(network.paint(&tasks)?));
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use paint_net::thesis::{Architecture, AttentionWindow};

    use super::*;

    /// Two sprays at one place: the first brings the ink to what is wanted, the second is too much; one beside the picture, too.
    #[test]
    fn what_lands_on_paint_that_is_enough_is_told() {
        let window = AttentionWindow { centre: (0.0, 0.0), extent: 1.0, sigma: 1.0 };
        let step = |position| Step { window, position, sigma: 1.5, volume: 0.6, gate: 1.0 };
        let wanted = Image::from_fn(9, 9, |x, _| if x < 5 { 0.5 } else { 0.9 });
        let mut canvas = wanted.map(|_| 0.0);
        assert!(!is_done(&canvas, &wanted, &step((4.0, 4.0))));
        stamp(&step((4.0, 4.0)), &mut canvas).unwrap();
        assert!(is_done(&canvas, &wanted, &step((4.3, 3.8))));
        // Beside it more is wanted: an ink of 0.74 at a depth of 0.96.
        stamp(&step((4.0, 4.0)), &mut canvas).unwrap();
        assert!(!is_done(&canvas, &wanted, &step((4.6, 4.0))));
        assert!(is_done(&canvas, &wanted, &step((-0.6, 4.0))) && is_done(&canvas, &wanted, &step((4.0, 8.5))));
    }

    #[test]
    fn volumes_stand_in_the_row_of_their_picture_and_the_column_of_their_step() {
        let architecture =
            Architecture { side: 8, steps: 5, latent: 2, hidden: 4, read: 2, radius: 3.0, stop: 0.9, paint: 3 };
        let network = Network::random(architecture, 3).unwrap();
        let pictures: Vec<Image> = (0..3).map(|k| Image::filled(8, 8, 0.3 * f64::from(k))).collect();
        let picture = volume_picture(&network, &pictures).unwrap();
        assert_eq!((picture.width, picture.height), (4 * 5, 4 * 3));
        let steps = &painted(&network, &pictures).unwrap()[1].1;
        let most =
            painted(&network, &pictures).unwrap().iter().flat_map(|p| &p.1).map(|s| s.volume).fold(0.0, f64::max);
        assert!((1..5).contains(&steps.len()), "{}", steps.len());
        for t in 0..5 {
            let expected = steps.get(t).map_or(0.0, |s| 255.0 * s.volume / most).round() as u8;
            assert_eq!(picture.data[3 * ((4 + 1) * 20 + 4 * t + 2)], expected, "{t}");
        }
    }
}
