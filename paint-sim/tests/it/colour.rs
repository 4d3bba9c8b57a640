//! Colours: CIEDE2000 against the published pairs, paints against printed digits.

use paint_sim::colour::ciede2000;
use paint_sim::colour::{
    BANDS, band_white, decode_srgb8, encode_srgb, encode_srgb8, spectrum_lab, spectrum_linear_srgb, spectrum_srgb8, xyz,
};
use paint_sim::paint::{Appearance, PaintName, ink_curve};
use paint_sim::{Error, Paint, Substrate};

/// The test data of Sharma, Wu and Dalal (2005), table 1: L1 a1 b1 L2 a2 b2 and the difference.
const SHARMA: [[f64; 7]; 34] = [
    [50.0, 2.6772, -79.7751, 50.0, 0.0, -82.7485, 2.0425],
    [50.0, 3.1571, -77.2803, 50.0, 0.0, -82.7485, 2.8615],
    [50.0, 2.8361, -74.0200, 50.0, 0.0, -82.7485, 3.4412],
    [50.0, -1.3802, -84.2814, 50.0, 0.0, -82.7485, 1.0000],
    [50.0, -1.1848, -84.8006, 50.0, 0.0, -82.7485, 1.0000],
    [50.0, -0.9009, -85.5211, 50.0, 0.0, -82.7485, 1.0000],
    [50.0, 0.0, 0.0, 50.0, -1.0, 2.0, 2.3669],
    [50.0, -1.0, 2.0, 50.0, 0.0, 0.0, 2.3669],
    [50.0, 2.4900, -0.0010, 50.0, -2.4900, 0.0009, 7.1792],
    [50.0, 2.4900, -0.0010, 50.0, -2.4900, 0.0010, 7.1792],
    [50.0, 2.4900, -0.0010, 50.0, -2.4900, 0.0011, 7.2195],
    [50.0, 2.4900, -0.0010, 50.0, -2.4900, 0.0012, 7.2195],
    [50.0, -0.0010, 2.4900, 50.0, 0.0009, -2.4900, 4.8045],
    [50.0, -0.0010, 2.4900, 50.0, 0.0010, -2.4900, 4.8045],
    [50.0, -0.0010, 2.4900, 50.0, 0.0011, -2.4900, 4.7461],
    [50.0, 2.5, 0.0, 50.0, 0.0, -2.5, 4.3065],
    [50.0, 2.5, 0.0, 73.0, 25.0, -18.0, 27.1492],
    [50.0, 2.5, 0.0, 61.0, -5.0, 29.0, 22.8977],
    [50.0, 2.5, 0.0, 56.0, -27.0, -3.0, 31.9030],
    [50.0, 2.5, 0.0, 58.0, 24.0, 15.0, 19.4535],
    [50.0, 2.5, 0.0, 50.0, 3.1736, 0.5854, 1.0000],
    [50.0, 2.5, 0.0, 50.0, 3.2972, 0.0, 1.0000],
    [50.0, 2.5, 0.0, 50.0, 1.8634, 0.5757, 1.0000],
    [50.0, 2.5, 0.0, 50.0, 3.2592, 0.3350, 1.0000],
    [60.2574, -34.0099, 36.2677, 60.4626, -34.1751, 39.4387, 1.2644],
    [63.0109, -31.0961, -5.8663, 62.8187, -29.7946, -4.0864, 1.2630],
    [61.2901, 3.7196, -5.3901, 61.4292, 2.2480, -4.9620, 1.8731],
    [35.0831, -44.1164, 3.7933, 35.0232, -40.0716, 1.5901, 1.8645],
    [22.7233, 20.0904, -46.6940, 23.0331, 14.9730, -42.5619, 2.0373],
    [36.4612, 47.8580, 18.3852, 36.2715, 50.5065, 21.2231, 1.4146],
    [90.8027, -2.0831, 1.4410, 91.1528, -1.6435, 0.0447, 1.4441],
    [90.9257, -0.5406, -0.9208, 88.6381, -0.8985, -0.7239, 1.5381],
    [6.7747, -0.2908, -2.4247, 5.8714, -0.0985, -2.2286, 0.6377],
    [2.0776, 0.0795, -1.1350, 0.9033, -0.0636, -0.5514, 0.9082],
];

#[test]
fn ciede2000_of_the_published_pairs() {
    for [l1, a1, b1, l2, a2, b2, expected] in SHARMA {
        for (first, second) in [([l1, a1, b1], [l2, a2, b2]), ([l2, a2, b2], [l1, a1, b1])] {
            let value = ciede2000(first, second);
            assert!((value - expected).abs() < 5.1e-5, "{first:?} {second:?}: {value} instead of {expected}");
        }
    }
    // More digits from an independent implementation.
    for ([l1, a1, b1, l2, a2, b2, _], exact) in
        [(SHARMA[0], 2.0424596801565764), (SHARMA[16], 27.14923130074626), (SHARMA[24], 1.2644200135991903)]
    {
        assert!((ciede2000([l1, a1, b1], [l2, a2, b2]) - exact).abs() < 1e-11);
    }
}

#[test]
fn the_white_of_the_bands() {
    let white = band_white();
    for (value, expected) in white.iter().zip([0.950119, 1.0, 1.088161]) {
        assert!((value - expected).abs() < 1e-6, "{white:?}");
    }
    let white = spectrum_srgb8(&[1.0; BANDS]);
    assert_eq!(white.rgb, [255; 3]);
}

/// The colour of a stack of paints, computed in Python from the pigments' formulas and the textbook form.
struct ExpectedColour {
    xyz: [f64; 3],
    lab: [f64; 3],
    rgb: [u8; 3],
    clipped: bool,
}

fn assert_colour(stack: &Substrate, expected: &ExpectedColour) {
    let reflectance = stack.reflectance();
    let (values, lab, screen) = (xyz(reflectance), spectrum_lab(reflectance), spectrum_srgb8(reflectance));
    for i in 0..3 {
        assert!((values[i] - expected.xyz[i]).abs() < 6e-8, "{values:?} instead of {:?}", expected.xyz);
        assert!((lab[i] - expected.lab[i]).abs() < 6e-5, "{lab:?} instead of {:?}", expected.lab);
    }
    assert_eq!(screen.rgb, expected.rgb);
    assert_eq!(screen.clipped, expected.clipped);
}

#[test]
fn stacks_of_the_synthetic_pigments() {
    // A film of one metre, since the formulas are for d = 1.
    let (yellow, blue, white) = (Paint::yellow(1.0).unwrap(), Paint::blue(1.0).unwrap(), Paint::white(1.0).unwrap());
    let ground = Substrate::grey(0.9).unwrap();
    assert_colour(
        &yellow.over(1.0, &ground).unwrap(),
        &ExpectedColour {
            xyz: [0.6749521, 0.6957015, 0.1333447],
            lab: [86.78561, 3.09571, 77.87654],
            rgb: [255, 212, 54],
            clipped: true,
        },
    );
    assert_colour(
        &blue.over(1.0, &ground).unwrap(),
        &ExpectedColour {
            xyz: [0.2201758, 0.2238477, 0.8257989],
            lab: [54.43290, 3.52461, -60.99152],
            rgb: [0, 135, 236],
            clipped: true,
        },
    );
    assert_colour(
        &white.over(1.0, &Substrate::grey(0.05).unwrap()).unwrap(),
        &ExpectedColour {
            xyz: [0.4867837, 0.5125842, 0.5565916],
            lab: [76.83528, -0.0636, 0.1132],
            rgb: [190, 190, 189],
            clipped: false,
        },
    );
    let mixed = Paint::mix(&[(yellow, 0.7), (blue, 0.3)]).unwrap().over(1.0, &ground).unwrap();
    assert_colour(
        &mixed,
        &ExpectedColour {
            xyz: [0.3689504, 0.4328191, 0.1435435],
            lab: [71.74589, -13.43306, 49.47531],
            rgb: [180, 181, 82],
            clipped: false,
        },
    );
    let yellow_on_top = yellow.over(0.7, &blue.over(0.3, &ground).unwrap()).unwrap();
    assert_colour(
        &yellow_on_top,
        &ExpectedColour {
            xyz: [0.4325981, 0.4893518, 0.1383666],
            lab: [75.41098, -9.35710, 57.03337],
            rgb: [201, 188, 75],
            clipped: false,
        },
    );
    let blue_on_top = blue.over(0.3, &yellow.over(0.7, &ground).unwrap()).unwrap();
    assert_colour(
        &blue_on_top,
        &ExpectedColour {
            xyz: [0.3259795, 0.3893049, 0.1661913],
            lab: [68.70089, -15.05826, 39.13009],
            rgb: [165, 174, 95],
            clipped: false,
        },
    );
    let difference =
        |a: &Substrate, b: &Substrate| ciede2000(spectrum_lab(a.reflectance()), spectrum_lab(b.reflectance()));
    assert!((difference(&mixed, &yellow_on_top) - 4.78569).abs() < 6e-6);
    assert!((difference(&yellow_on_top, &blue_on_top) - 9.45089).abs() < 6e-6);
}

#[test]
fn the_unit_of_thickness_is_only_a_unit() {
    let ground = Substrate::grey(0.3).unwrap();
    let thick = Paint::yellow(1.0).unwrap().over(0.5, &ground).unwrap();
    let thin = Paint::yellow(40e-6).unwrap().over(20e-6, &ground).unwrap();
    for (a, b) in thick.reflectance().iter().zip(thin.reflectance()) {
        assert!((a - b).abs() < 1e-14);
    }
    assert_eq!(Paint::yellow(40e-6).unwrap().over(0.0, &ground).unwrap(), ground);
}

#[test]
fn srgb_codes_survive_decoding() {
    for code in 0..=255 {
        assert_eq!(encode_srgb8(decode_srgb8(code)), (code, false));
    }
    // IEC 61966-2-1: half the code range is 21.4 % of the light.
    assert!((decode_srgb8(128) - 0.21586).abs() < 1e-5);
    // Next to each step and between them it is the curve, rounded.
    let rounded = |linear: f64| (encode_srgb(linear) * 255.0).round() as u8;
    let mut codes = 0;
    for k in 0..=300_000 {
        let linear = f64::from(k) / 300_000.0;
        let float = f64::from(linear as f32);
        assert_eq!(
            [encode_srgb8(linear), encode_srgb8(float)],
            [linear, float].map(|l| (rounded(l), false)),
            "{linear}"
        );
        if k > 0 && rounded(linear) > rounded(linear - 1.0 / 300_000.0) {
            codes += 1;
            let (mut low, mut high) = (linear - 1.0 / 300_000.0, linear);
            while low.next_up() < high {
                let middle = f64::midpoint(low, high);
                if rounded(middle) < rounded(high) { low = middle } else { high = middle }
            }
            assert_eq!([low, high].map(|l| encode_srgb8(l).0), [low, high].map(rounded));
        }
    }
    assert_eq!(codes, 255);
    assert_eq!(encode_srgb8(f64::NAN), (0, true));
    assert_eq!(encode_srgb8(1.052), (255, true));
    assert_eq!(encode_srgb8(-0.042), (0, true));
}

#[test]
fn bad_paints_are_refused() {
    let k = [1.0; BANDS];
    let mut bad = k;
    bad[7] = f64::NAN;
    assert!(matches!(Paint::new(&bad, &k, 1.0), Err(Error::OutOfRange { .. })));
    assert!(matches!(Paint::new(&k, &k, 0.0), Err(Error::OutOfRange { .. })));
    assert!(matches!(Paint::mix(&[]), Err(Error::Empty { .. })));
    let yellow = Paint::yellow(1.0).unwrap();
    assert!(Paint::mix(&[(yellow, 0.0)]).is_err() && Paint::mix(&[(yellow, -1.0)]).is_err());
    assert!(yellow.over(f64::NAN, &Substrate::grey(0.5).unwrap()).is_err());
    assert!(Substrate::grey(1.1).is_err());
}

#[test]
fn an_appearance_is_the_paint_over_its_substrate() {
    let wall = Substrate::sandstone();
    for name in PaintName::ALL {
        let paint = name.paint(20e-6).unwrap();
        let table = Appearance::new(&paint, &wall, 20e-6, 4.0).unwrap();
        for depth in [0.0, 0.013, 0.4, 1.0, 2.7, 4.0] {
            let film = paint.over(20e-6 * depth, &wall).unwrap();
            let exact = spectrum_lab(film.reflectance());
            assert!(ciede2000(table.lab(depth), exact) < 0.02, "{} at {depth}", name.as_str());
            let (light, exact) = (table.linear(depth), spectrum_linear_srgb(film.reflectance()));
            let off = light.iter().zip(exact).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(off < 1e-3, "{} at {depth}: {light:?} instead of {exact:?}", name.as_str());
        }
        assert_eq!(table.lab(9.0), table.lab(4.0));
    }
    // Ink rises with the depth of charcoal, from nothing to nearly all.
    let knots = ink_curve(&PaintName::Charcoal.paint(20e-6).unwrap(), &wall, 20e-6, 4.0).unwrap();
    assert_eq!(knots[0], (0.0, 0.0));
    assert!(knots.windows(2).all(|pair| pair[0].1 < pair[1].1) && (0.99..1.0).contains(&knots[knots.len() - 1].1));
    assert!(matches!(ink_curve(&Paint::white(1e-6).unwrap(), &wall, 0.0, 4.0), Err(Error::OutOfRange { .. })));
}

/// The formulas of the named paints at the ends of the spectrum: 380 and 730 nm, or where their steps lie.
#[test]
fn named_paints_absorb_what_their_formulas_say() {
    let at = |paint: PaintName, wavelength: usize| paint.paint(20e-6).unwrap().absorption()[(wavelength - 380) / 10];
    for (paint, wavelength, expected) in [
        (PaintName::Charcoal, 380, 1.5),
        (PaintName::Charcoal, 730, 1.43),
        (PaintName::Red, 590, 0.03 + 2.4 / (1.0 + (-5.0_f64 / 9.0).exp())),
        (PaintName::Green, 530, 0.04),
        (PaintName::Blue, 510, 1.15),
    ] {
        // In units of the thickness that the formulas hold for.
        let found = at(paint, wavelength) * 20e-6;
        assert!((found - expected).abs() < 1e-9, "{paint:?} at {wavelength} nm: {found} instead of {expected}");
    }
}
