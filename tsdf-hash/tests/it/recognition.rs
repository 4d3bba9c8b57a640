//! A frame is recognised by its features: far beside the keyframes, and not in another room.

use nalgebra::{Isometry3, UnitQuaternion};
use tsdf_hash::place_recognition::{KeyframeIndex, RecognisedPlace};

use crate::noisy_room::{apart, seen, unit};
use crate::random::Random;
use crate::scene::{Shot, room};

fn keyframes(random: &mut Random) -> KeyframeIndex {
    let mut keyframes = KeyframeIndex::new();
    for k in 0..60 {
        let shot = seen(room::pose(k, 60), random).painted(|p| room::colour(p, 0.0));
        keyframes.push(&shot.view(), shot.colour().as_ref(), &shot.world_from_camera).unwrap();
    }
    keyframes
}

fn recognised(keyframes: &KeyframeIndex, shot: &Shot) -> Option<RecognisedPlace> {
    keyframes.recognise(&shot.view(), shot.colour().as_ref(), 5, |_| true).unwrap().first().copied()
}

/// Thirty centimetres beside the way, turned by twelve degrees and rolled by forty-five.
#[test]
fn a_frame_is_recognised_from_elsewhere() {
    let mut random = Random::new(3);
    let keyframes = keyframes(&mut random);
    let (mut right, mut wrong) = (0, 0);
    for k in 0..30 {
        let turn = UnitQuaternion::from_euler_angles(0.0, 0.0, 0.79) * UnitQuaternion::new(unit(&mut random) * 0.2);
        let truth = room::pose(2 * k, 60) * Isometry3::from_parts((unit(&mut random) * 0.3).into(), turn);
        let shot = seen(truth, &mut random).painted(|p| room::colour(p, 0.0));
        if let Some(found) = recognised(&keyframes, &shot) {
            let (metres, radians) = apart(&found.world_from_camera, &truth);
            *(if metres < 0.05 && radians < 0.05 { &mut right } else { &mut wrong }) += 1;
        }
    }
    assert!(right >= 24 && wrong == 0, "{right} right, {wrong} wrong of 30");
}

#[test]
fn another_room_and_the_dark_are_not_recognised() {
    let mut random = Random::new(4);
    let keyframes = keyframes(&mut random);
    for k in 0..20 {
        let shot = seen(room::pose(3 * k, 60), &mut random);
        assert!(recognised(&keyframes, &shot).is_none(), "dark {k}");
        let repainted = shot.painted(|p| room::colour(p, 5.0));
        assert!(recognised(&keyframes, &repainted).is_none(), "repainted {k}");
    }
}

/// Words of the room itself serve as well, and a stored index recognises what the first one did.
#[test]
fn words_can_be_trained_and_features_are_stored() {
    let mut random = Random::new(5);
    let keyframes = keyframes(&mut random);
    let stored = KeyframeIndex::from_bytes(&keyframes.to_bytes()).unwrap();
    let own = keyframes.clone().with_vocabulary(keyframes.train_vocabulary(1));
    for k in [7, 23, 48] {
        let truth = room::pose(k, 60) * Isometry3::translation(0.1, 0.05, 0.0);
        let shot = seen(truth, &mut random).painted(|p| room::colour(p, 0.0));
        let places = [&keyframes, &stored, &own].map(|index| recognised(index, &shot).unwrap());
        assert_eq!(places[0].world_from_camera, places[1].world_from_camera);
        for place in places {
            assert!(apart(&place.world_from_camera, &truth).0 < 0.05 && place.agreeing >= 12, "{k}: {place:?}");
        }
    }
}
