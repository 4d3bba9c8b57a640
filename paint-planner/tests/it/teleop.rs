//! Teleoperation: Algorithm 1 and its rules on sequences worked by hand, segments, latencies.

#![allow(clippy::unwrap_used, reason = "the helpers of the tests are tests as well")]

use paint_planner::nalgebra::{Isometry3, Point3, Vector3};
use paint_planner::teleop::{
    CradlePose, FarReference, Feedback, LagIndicator, LiveQueue, PaintHit, RATE, Segment, SessionSettings, Task,
    TaskKind, VERSION, VrMode, VrState, latency_in_time, segments,
};

/// Where the vehicle stands unless a test says otherwise.
const VEHICLE: Point3<f64> = Point3::new(-0.7, 0.0, 2.0);

/// The `k`-th state of a hand 10 cm before the wall x = 0 that is at `y`.
pub(crate) fn state(k: u64, mode: VrMode, y: f64) -> VrState {
    VrState {
        version: VERSION,
        sequence: k,
        time: k as f64 / RATE,
        mode,
        nozzle: Isometry3::translation(-0.1, y, 2.0),
        cradle: CradlePose { position: VEHICLE, heading: 0.0 },
        hit: (mode == VrMode::Painting).then(|| hit(y)),
        colour: 0,
        flow: 1e-6,
    }
}

pub(crate) fn hit(y: f64) -> PaintHit {
    PaintHit { point: Point3::new(0.0, y, 2.0), normal: -Vector3::x_axis() }
}

fn settings(segment: f64) -> SessionSettings {
    SessionSettings { segment, longest: segment, ..SessionSettings::default() }
}

/// Pushes everything, then lets the algorithm run until nothing is left.
fn run(queue: &mut LiveQueue, states: &[VrState]) -> Vec<Task> {
    for state in states {
        queue.push(*state);
    }
    let now = states.last().unwrap().time;
    let mut tasks = Vec::new();
    while let Some(task) = queue.next_task(now, &VEHICLE) {
        tasks.push(task);
    }
    tasks
}

/// Sequence numbers of the states of each task; a task of one state says which rule it is.
fn summary(tasks: &[Task]) -> Vec<String> {
    let one = |task: &Task| match task {
        Task::Approach(state) => format!("approach {}", state.sequence),
        Task::Seek(state) => format!("seek {}", state.sequence),
        Task::Segment(segment) => {
            let (first, last) = (segment.states[0].sequence, segment.states[segment.states.len() - 1].sequence);
            format!("{:?} {first}..{last} {:.3} m", segment.mode, segment.length)
        }
    };
    tasks.iter().map(one).collect()
}

#[test]
fn a_stroke_is_approached_cut_at_the_threshold_and_flushed_at_the_release() {
    // Steps of 3 cm, a threshold of 10 cm: full after the states 4 and 8, the state that fills a segment begins the next.
    let mut states = vec![state(0, VrMode::Idle, 0.0)];
    states.extend((0..10).map(|k| state(k + 1, VrMode::Painting, 0.03 * k as f64)));
    states.push(state(11, VrMode::Idle, 0.27));
    let mut queue = LiveQueue::new(settings(0.1));
    let tasks = run(&mut queue, &states);
    let expected = ["approach 1", "Painting 1..5 0.120 m", "Painting 5..9 0.120 m", "Painting 9..10 0.030 m"];
    assert_eq!(summary(&tasks), expected);
    let starts: Vec<f64> =
        tasks[1..].iter().map(|task| if let Task::Segment(s) = task { s.start } else { -1.0 }).collect();
    assert!(starts.iter().zip([0.0, 0.12, 0.24]).all(|(a, b)| (a - b).abs() < 1e-12), "{starts:?}");
    assert!(queue.is_empty() && (queue.painted_length() - 0.27).abs() < 1e-12);
}

#[test]
fn a_stroke_that_ends_on_the_threshold_leaves_no_stub() {
    let mut states: Vec<VrState> = (0..5).map(|k| state(k, VrMode::Painting, 0.025 * k as f64)).collect();
    states.push(state(5, VrMode::Idle, 0.1));
    let mut queue = LiveQueue::new(settings(0.0999));
    assert_eq!(summary(&run(&mut queue, &states)), ["approach 0", "Painting 0..4 0.100 m"]);
    // A dab of one state afterwards is a stroke of its own.
    let dab = [state(6, VrMode::Painting, 0.3), state(7, VrMode::Idle, 0.3)];
    assert_eq!(summary(&run(&mut queue, &dab)), ["approach 6", "Painting 6..6 0.000 m"]);
}

#[test]
fn a_vehicle_that_is_behind_takes_longer_segments() {
    let mut states: Vec<VrState> = (0..20).map(|k| state(k, VrMode::Painting, 0.03 * k as f64)).collect();
    states.push(state(20, VrMode::Idle, 0.57));
    let mut queue = LiveQueue::new(SessionSettings { longest: 0.25, ..settings(0.1) });
    let expected = ["approach 0", "Painting 0..9 0.270 m", "Painting 9..18 0.270 m", "Painting 18..19 0.030 m"];
    assert_eq!(summary(&run(&mut queue, &states)), expected);
}

#[test]
fn an_empty_queue_in_the_middle_of_a_stroke_waits_for_the_timeout() {
    let mut queue = LiveQueue::new(settings(1.0));
    let states: Vec<VrState> = (0..4).map(|k| state(k, VrMode::Painting, 0.02 * k as f64)).collect();
    assert_eq!(summary(&run(&mut queue, &states)), ["approach 0"]);
    let last = states[3].time;
    assert!(queue.step(last + 0.29, &VEHICLE).is_none());
    assert_eq!(summary(&[queue.step(last + 0.31, &VEHICLE).unwrap()]), ["Painting 0..3 0.060 m"]);
}

#[test]
fn the_release_makes_the_person_wait_until_the_queue_is_empty() {
    let mut queue = LiveQueue::new(settings(0.1));
    for k in 0..4 {
        queue.push(state(k, VrMode::Painting, 0.02 * k as f64));
    }
    queue.push(state(4, VrMode::Idle, 0.06));
    assert_eq!(queue.take_feedback(), [Feedback::Wait { states: 5 }]);
    // Pressed again at once: refused, and said so once.
    queue.push(state(5, VrMode::Painting, 0.5));
    queue.push(state(6, VrMode::Painting, 0.51));
    assert_eq!(queue.take_feedback(), [Feedback::Wait { states: 5 }]);
    assert_eq!(queue.counts().refused_waiting, 2);
    assert_eq!(summary(&run(&mut queue, &[state(7, VrMode::Painting, 0.52)])), ["approach 0", "Painting 0..3 0.060 m"]);
    assert_eq!(queue.take_feedback(), [Feedback::Ready]);
    // The stroke goes on from where the queue was empty.
    let states = [state(8, VrMode::Painting, 0.53), state(9, VrMode::Painting, 0.54), state(10, VrMode::Idle, 0.54)];
    assert_eq!(summary(&run(&mut queue, &states)), ["approach 8", "Painting 8..9 0.010 m"]);
    assert_eq!((queue.counts().accepted, queue.counts().refused_waiting), (6, 3));
}

#[test]
fn painting_from_afar_is_refused_and_what_was_near_is_kept() {
    let far = |k, y| VrState { nozzle: Isometry3::translation(-1.2, y, 2.0), ..state(k, VrMode::Painting, y) };
    let states = [
        state(0, VrMode::Painting, 0.0),
        state(1, VrMode::Painting, 0.02),
        far(2, 0.03),
        far(3, 0.04),
        state(4, VrMode::Painting, 0.05),
        state(5, VrMode::Idle, 0.05),
    ];
    let mut queue = LiveQueue::new(settings(1.0));
    let tasks = run(&mut queue, &states);
    assert_eq!(summary(&tasks), ["approach 0", "Painting 0..1 0.020 m", "approach 4", "Painting 4..4 0.000 m"]);
    let closer: Vec<Feedback> =
        queue.take_feedback().into_iter().filter(|f| matches!(f, Feedback::MoveCloser { .. })).collect();
    assert_eq!(closer, [Feedback::MoveCloser { distance: 1.2 }]);
    assert_eq!(queue.counts().far, 2);
    // As printed, the distance is the vehicle's, which is 70 cm from the wall here and would not mind.
    let printed = SessionSettings { far_reference: FarReference::Vehicle, ..settings(1.0) };
    let mut queue = LiveQueue::new(printed);
    assert_eq!(summary(&run(&mut queue, &states)), ["approach 0", "Painting 0..4 0.050 m"]);
}

#[test]
fn the_vehicle_seeks_a_cradle_that_is_a_metre_away() {
    let at = |k, x: f64| VrState {
        cradle: CradlePose { position: VEHICLE + Vector3::new(x, 0.0, 0.0), heading: 0.0 },
        ..state(k, VrMode::Idle, 0.0)
    };
    let mut queue = LiveQueue::new(settings(1.0));
    assert!(run(&mut queue, &[at(0, -0.99)]).is_empty());
    assert_eq!(
        summary(&run(&mut queue, &[at(1, -1.2), at(2, -1.01)])),
        ["seek 2"],
        "of a pause its latest state counts"
    );
}

#[test]
fn viewing_is_measured_at_the_nozzle_and_a_change_of_mode_flushes() {
    let mut states: Vec<VrState> = (0..3).map(|k| state(k, VrMode::Viewing, 0.1 * k as f64)).collect();
    states.extend((3..5).map(|k| state(k, VrMode::Painting, 0.01 * k as f64)));
    states.push(state(5, VrMode::Idle, 0.0));
    let mut queue = LiveQueue::new(settings(0.5));
    let expected = ["approach 0", "Viewing 0..2 0.200 m", "approach 3", "Painting 3..4 0.010 m"];
    assert_eq!(summary(&run(&mut queue, &states)), expected);
}

#[test]
fn a_full_queue_refuses_and_says_so_once() {
    let mut queue = LiveQueue::new(SessionSettings { capacity: 3, ..settings(1.0) });
    for k in 0..6 {
        queue.push(state(k, VrMode::Painting, 0.01 * k as f64));
    }
    assert_eq!((queue.len(), queue.counts().refused_full), (3, 3));
    assert_eq!(queue.take_feedback(), [Feedback::QueueFull { capacity: 3 }]);
}

#[test]
fn offline_segments_run_from_press_to_release_and_break_at_jumps() {
    let p = VrMode::Painting;
    let turned = PaintHit { normal: -Vector3::y_axis(), ..hit(0.12) };
    let states = [
        state(0, VrMode::Idle, 0.0),
        state(1, p, 0.0),
        state(2, p, 0.02),
        VrState { hit: None, ..state(3, p, 0.0) }, // within 50 ms: the stroke goes on
        state(4, p, 0.04),
        state(5, p, 0.1), // a jump of 6 cm
        VrState { hit: Some(turned), ..state(6, p, 0.0) },
        VrState { hit: Some(turned), colour: 1, ..state(7, p, 0.0) },
        state(8, VrMode::Viewing, 0.0),
        state(9, VrMode::Viewing, 0.3),
        state(10, VrMode::Idle, 0.0),
        state(11, p, 0.0),
        state(17, p, 0.01), // 67 ms without a state
    ];
    let found: Vec<Task> = segments(states, &SessionSettings::default()).into_iter().map(Task::Segment).collect();
    let expected = [
        "Painting 1..4 0.040 m",
        "Painting 5..5 0.000 m",
        "Painting 6..6 0.000 m",
        "Painting 7..7 0.000 m",
        "Viewing 8..9 0.300 m",
        "Painting 11..11 0.000 m",
        "Painting 17..17 0.000 m",
    ];
    assert_eq!(summary(&found), expected);
}

/// The protocol of the VR paper, Section VI-B: the hand paints 7.75 m; a segment is planned when the nozzle has finished the one before
/// it. Returns least and greatest latency in distance (m, from the first flight until the hand stops) and in time (s, at each plan).
fn latencies(segment: f64, hand: f64, planning: f64, nozzle: f64) -> ([f64; 2], [f64; 2]) {
    let mut queue = LiveQueue::new(settings(segment));
    let (mut free, mut flying): (f64, Option<(f64, Segment)>) = (0.0, None);
    let (mut distance, mut time) = ([f64::MAX, 0.0], [f64::MAX, 0.0_f64]);
    let widen = |range: &mut [f64; 2], value: f64| *range = [range[0].min(value), range[1].max(value)];
    for k in 0..=(7.75 / hand * RATE) as u64 {
        let now = k as f64 / RATE;
        queue.push(state(k, VrMode::Painting, hand * now));
        while now >= free {
            match queue.next_task(now, &VEHICLE) {
                Some(Task::Segment(segment)) => {
                    widen(&mut time, latency_in_time(now + planning, &segment));
                    free = now + planning + segment.length / nozzle;
                    flying = Some((now + planning, segment));
                }
                Some(_) => {}
                None => break,
            }
        }
        if let Some((begin, segment)) = flying.as_ref().filter(|(begin, _)| now >= *begin) {
            let flown = segment.start + ((now - begin) * nozzle).min(segment.length);
            widen(&mut distance, queue.painted_length() - flown);
        }
    }
    (distance, time)
}

#[test]
fn the_latencies_of_the_paper_come_out_of_its_protocol() {
    // Worked out in closed form: segment k is complete at k D/v, and the nozzle is as fast as the hand or faster.
    let near = |[low, high]: [f64; 2], wanted: [f64; 2], tolerance: f64| {
        assert!(
            (low - wanted[0]).abs() < tolerance && (high - wanted[1]).abs() < tolerance,
            "{low} {high}, {wanted:?}"
        );
    };
    let (distance, time) = latencies(1.0, 0.08, 0.356, 0.08);
    near(distance, [1.03, 1.20], 0.01);
    near(time, [12.9, 15.0], 0.1);
    // With a faster nozzle every wait ends before the next segment is complete.
    let (distance, time) = latencies(0.5, 0.08, 0.189, 0.15);
    near(distance, [0.28, 0.52], 0.01);
    near(time, [6.4, 6.5], 0.1);
}

#[test]
fn the_vehicle_is_shown_while_it_lags() {
    let mut indicator = LagIndicator::default();
    let mut told = |lag| indicator.update(lag, &SessionSettings::default());
    assert_eq!(told(0.5), None);
    assert_eq!(told(0.51), Some(Feedback::ShowVehicle { lag: 0.51 }));
    assert_eq!(told(0.3), None);
    assert_eq!(told(0.25), Some(Feedback::HideVehicle));
    assert_eq!(told(0.3), None);
}

#[test]
fn the_next_piece_of_a_stroke_may_be_asked_for_in_flight_and_nothing_else() {
    let mut queue = LiveQueue::new(settings(0.1));
    queue.push(state(0, VrMode::Painting, 0.0));
    // Nothing is under way yet: the approach is a task.
    assert_eq!(queue.next_continuation(0.0, &VEHICLE), None);
    assert!(matches!(queue.next_task(0.0, &VEHICLE), Some(Task::Approach(_))));
    for k in 1..6 {
        queue.push(state(k, VrMode::Painting, 0.03 * k as f64));
    }
    let piece = queue.next_continuation(0.1, &VEHICLE).unwrap();
    assert_eq!((piece.states[0].sequence, piece.states.last().unwrap().sequence), (0, 4));
    // One more state is no piece; the release ends it, and what follows the release is left alone.
    assert_eq!(queue.next_continuation(0.1, &VEHICLE), None);
    queue.push(state(6, VrMode::Idle, 0.15));
    let piece = queue.next_continuation(0.1, &VEHICLE).unwrap();
    assert_eq!((piece.states[0].sequence, piece.states.last().unwrap().sequence), (4, 5));
    assert_eq!(queue.next_continuation(0.2, &VEHICLE), None);
    assert_eq!(queue.len(), 1);
}

#[test]
fn a_piece_that_is_given_back_grows_until_the_vehicle_asks_for_a_task() {
    let mut queue = LiveQueue::new(SessionSettings { longest: 1.0, ..settings(0.1) });
    queue.push(state(0, VrMode::Painting, 0.0));
    assert!(matches!(queue.next_task(0.0, &VEHICLE), Some(Task::Approach(_))));
    (1..6).for_each(|k| queue.push(state(k, VrMode::Painting, 0.03 * k as f64)));
    let before = queue.painted_length();
    let piece = queue.next_continuation(0.1, &VEHICLE).unwrap();
    queue.give_back(piece);
    assert!((queue.painted_length() - before).abs() < 1e-12);
    // What has come since is part of it, and every state is in it once.
    (6..11).for_each(|k| queue.push(state(k, VrMode::Painting, 0.03 * k as f64)));
    let Some(Task::Segment(whole)) = queue.next_task(0.2, &VEHICLE) else { panic!("it is full") };
    let sequences: Vec<u64> = whole.states.iter().map(|state| state.sequence).collect();
    assert_eq!(sequences, (0..11).collect::<Vec<_>>());
    assert!(whole.start == 0.0 && (whole.length - 0.3).abs() < 1e-12, "{}", whole.length);
    // Where nothing more has come it need not wait for the end of the stroke.
    (11..16).for_each(|k| queue.push(state(k, VrMode::Painting, 0.03 * k as f64)));
    let piece = queue.next_continuation(0.2, &VEHICLE).unwrap();
    assert_eq!(queue.next_continuation(0.2, &VEHICLE), None);
    let (start, length) = (piece.start, piece.length);
    queue.give_back(piece);
    let Some(Task::Segment(again)) = queue.next_task(0.2, &VEHICLE) else { panic!("it is full") };
    assert!(again.start == start && again.length >= length && (start - 0.3).abs() < 1e-12);
}

#[test]
fn tasks_have_the_names_of_the_rules() {
    let names = [TaskKind::Paint, TaskKind::View, TaskKind::Approach, TaskKind::Seek].map(TaskKind::name);
    assert_eq!(names, ["paint", "view", "approach", "seek"]);
}
