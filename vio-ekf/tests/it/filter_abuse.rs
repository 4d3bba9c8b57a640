//! Everything that goes wrong in the air: the estimate survives, or says that it has not.

use crate::support::abuse::{ABUSES, Outcome, run};

#[test]
fn no_light_and_too_much_of_it() {
    // The paint flights of the suite, small images: black-out and over-exposure.
    for k in [32, 33] {
        let (abuse, name, outcome) = run(k, 9.0, 1).unwrap();
        eprintln!("{abuse:?} {name}: {outcome:?}");
        assert!(outcome.finite && outcome.survived, "{abuse:?}: {outcome:?}");
    }
}

/// The suite, 60 cases of 15 s, and its table: `cargo test --release -p vio-ekf --test it filter_abuse -- --ignored
/// --nocapture`. `CASES` is a list of cases instead, `VIO_TRACE` shows the errors of every image.
#[test]
#[ignore = "renders 18,000 images"]
fn sixty_cases() {
    let cases: Vec<u64> = match std::env::var("CASES") {
        Ok(list) => list.split(',').map(|text| text.parse().unwrap()).collect(),
        Err(_) => (0..60).collect(),
    };
    let mut outcomes: Vec<Vec<Outcome>> = vec![Vec::new(); ABUSES.len()];
    for k in cases {
        let Some((abuse, name, outcome)) = run(k, 15.0, 0) else { continue };
        let Outcome { position_error, velocity_error, flagged, survived, finite } = outcome;
        eprintln!(
            "{k:2} {abuse:?} {name}: {position_error:.3} m, {velocity_error:.3} m/s, flagged {flagged}, finite {finite}: {}",
            if survived {
                "survived"
            } else if flagged {
                "told"
            } else {
                "SILENT"
            }
        );
        outcomes[k as usize % ABUSES.len()].push(outcome);
    }
    eprintln!("| abuse | cases | survived | told | silent | worst of the survivors |\n|---|---|---|---|---|---|");
    for (abuse, outcomes) in ABUSES.iter().zip(&outcomes) {
        let count = |of: &dyn Fn(&Outcome) -> bool| outcomes.iter().filter(|o| of(o)).count();
        let worst = outcomes.iter().filter(|o| o.survived).map(|o| o.position_error).fold(0.0, f64::max);
        eprintln!(
            "| {abuse:?} | {} | {} | {} | {} | {worst:.3} m |",
            outcomes.len(),
            count(&|o| o.survived),
            count(&|o| o.flagged),
            count(&|o| !o.survived && !o.flagged)
        );
    }
    let all: Vec<&Outcome> = outcomes.iter().flatten().collect();
    let survived = all.iter().filter(|o| o.survived).count();
    eprintln!("{survived} of {} survived", all.len());
    assert!(all.iter().all(|o| o.finite && (o.survived || o.flagged)), "a divergence that was not told");
    assert!(survived as f64 >= 0.95 * all.len() as f64, "{survived} of {}", all.len());
}
