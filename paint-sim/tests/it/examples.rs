//! The examples do what they say, and the recipe of the README is the first of them.

use paint_sim::Paint;
use paint_sim::colour::ciede2000;

#[expect(dead_code, reason = "what `main` prints is compared here")]
#[path = "../../examples/layers.rs"]
mod layers;

#[test]
fn the_recipe_is_the_example() {
    let (readme, example) = (include_str!("../../README.md"), include_str!("../../examples/spray.rs"));
    let program = example.split_once("\n\n").unwrap().1;
    assert!(readme.contains(&format!("```rust\n{program}```\n")), "README.md does not hold examples/spray.rs");
}

#[test]
fn the_upper_of_two_thick_layers_hides_the_lower_in_the_example() {
    let (yellow, blue) = (Paint::yellow(50e-6).unwrap(), Paint::blue(50e-6).unwrap());
    let (under, alone) = (layers::coats(&yellow, &blue, 5e-3).unwrap(), layers::coats(&blue, &blue, 5e-3).unwrap());
    assert!(ciede2000(under, alone) < 0.01 && ciede2000(under, layers::coats(&blue, &yellow, 5e-3).unwrap()) > 30.0);
}
