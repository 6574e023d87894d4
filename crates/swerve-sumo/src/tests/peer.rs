//! A peer that speaks TraCI as SUMO does, with vehicles that a test gives it.

use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::time::Duration;

use swerve_core::Time;
use swerve_geom::Pose2;
use swerve_msg::ActorKind;
use swerve_world::{Other, Others as _};

use super::{ego, settings};
use crate::client::Client;
use crate::{Sumo, SumoError};

/// Vehicles by the number of the step: name, place of the front bumper, angle.
type Vehicles = Box<dyn Fn(u32) -> Option<Vec<(String, [f64; 2], f64)>> + Send>;

fn text(out: &mut Vec<u8>, text: &str) {
    out.extend((text.len() as u32).to_be_bytes());
    out.extend(text.as_bytes());
}

fn command(out: &mut Vec<u8>, id: u8, content: &[u8]) {
    out.push(0);
    out.extend((content.len() as u32 + 6).to_be_bytes());
    out.push(id);
    out.extend(content);
}

/// Answer to the subscription around the ego.
fn around(vehicles: &[(String, [f64; 2], f64)]) -> Vec<u8> {
    let mut content = Vec::new();
    text(&mut content, "swerve.ego");
    content.extend([0xa4, 7]);
    content.extend((vehicles.len() as u32).to_be_bytes());
    for (name, [x, y], angle) in vehicles {
        text(&mut content, name);
        content.extend([0x42, 0, 0x01]);
        content.extend([x.to_be_bytes(), y.to_be_bytes()].concat());
        for (variable, value) in [(0x43, *angle), (0x40, 10.0), (0x44, 4.0), (0x4d, 1.8), (0xbc, 1.5)] {
            content.extend([variable, 0, 0x0b]);
            content.extend(f64::to_be_bytes(value));
        }
        content.extend([0x49, 0, 0x0c]);
        text(&mut content, "passenger");
    }
    let mut out = Vec::new();
    command(&mut out, 0x94, &content);
    out
}

/// Answers requests until the test closes the connection, or a step has no vehicles.
fn serve(mut peer: TcpStream, vehicles: &Vehicles) -> Option<()> {
    let mut step = 0;
    loop {
        let mut head = [0; 4];
        peer.read_exact(&mut head).ok()?;
        let mut body = vec![0; u32::from_be_bytes(head) as usize - 4];
        peer.read_exact(&mut body).ok()?;
        let mut out = Vec::new();
        let mut rest = &body[..];
        while !rest.is_empty() {
            let (length, start) = match rest[0] {
                0 => (u32::from_be_bytes(rest[1..5].try_into().unwrap()) as usize, 5),
                short => (usize::from(short), 1),
            };
            let id = rest[start];
            rest = &rest[length..];
            command(&mut out, id, &[0, 0, 0, 0, 0]);
            match id {
                0x00 => {
                    let mut content = 22_u32.to_be_bytes().to_vec();
                    text(&mut content, "peer");
                    command(&mut out, 0x00, &content);
                }
                0x02 => {
                    step += 1;
                    out.extend(u32::from(step > 1).to_be_bytes());
                    if step > 1 {
                        out.extend(around(&vehicles(step)?));
                    }
                }
                0x84 => out.extend(around(&vehicles(step)?)),
                0xa2 => {
                    let mut content = vec![0];
                    text(&mut content, "");
                    content.extend([0x0e, 0, 0, 0, 0]);
                    command(&mut out, 0xb2, &content);
                }
                _ => {}
            }
        }
        peer.write_all(&((out.len() as u32 + 4).to_be_bytes())).ok()?;
        peer.write_all(&out).ok()?;
    }
}

/// A run with an ego at rest at the origin; the first step of the peer ends at instant 0.
fn run(vehicles: Vehicles, steps: i64) -> Result<Vec<Vec<Other>>, String> {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let stream = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
    let server = std::thread::spawn(move || serve(listener.accept().unwrap().0, &vehicles));
    let client = Client::new(stream, Duration::from_secs(5)).unwrap();
    let settings = crate::Settings { warmup_s: 0.1, ..settings("x.sumocfg".as_ref(), &[]) };
    let mut sumo = Sumo::new(settings);
    let (truth, outline) = ego(Pose2::default(), 0.0);
    let begun = sumo.begin_with(client, &truth, &outline).map_err(|error| error.to_string());
    let states = begun.and_then(|()| {
        let at = |k: i64| sumo.at(Time::from_ms(5 * k), &truth, &outline).map(<[Other]>::to_vec);
        (0..steps).map(at).collect::<Result<_, _>>().map_err(|error| error.0)
    });
    drop(sumo);
    server.join().unwrap();
    states
}

fn one(name: &str, x_m: f64, y_m: f64) -> (String, [f64; 2], f64) {
    (name.to_owned(), [x_m, y_m], 90.0)
}

#[test]
fn vehicles_move_in_straight_lines_between_steps_and_turn_by_the_short_way() {
    let moves = |step: u32| {
        let k = f64::from(step - 1);
        let angle_deg = if step % 2 == 1 { 359.0 } else { 1.0 };
        Some(vec![one("b", 20.0 + k, 5.0), ("turns".to_owned(), [0.0, 50.0], angle_deg)])
    };
    let states = run(Box::new(moves), 41).unwrap();
    for (k, state) in states.iter().enumerate() {
        let [straight, turning] = &state[..] else { panic!("{state:?}") };
        let x_m = 18.0 + k as f64 / 20.0;
        assert!((straight.movement.pose.x_m - x_m).abs() < 1e-9, "step {k}: {straight:?}");
        assert!(k == 0 || (straight.movement.velocity_mps.x - 10.0).abs() < 1e-9);
        let heading_deg = turning.movement.pose.heading_rad.to_degrees();
        assert!((heading_deg - 90.0).abs() < 1.0 + 1e-9, "step {k}: {heading_deg}");
        assert_eq!((straight.id.0, straight.kind, straight.extent.length_m), (1, ActorKind::Car, 4.0));
    }
}

#[test]
fn vehicles_keep_their_identity_when_they_come_back_and_jumps_are_not_interpolated() {
    let moves = |step: u32| match step {
        1 => Some(vec![one("a", 20.0, 5.0)]),
        2 => Some(vec![one("b", 30.0, 5.0)]),
        3 => Some(vec![one("a", 20.0, 5.0), one("b", 90.0, 5.0)]),
        _ => Some(Vec::new()),
    };
    let states = run(Box::new(moves), 61).unwrap();
    let ids = |k: usize| states[k].iter().map(|other| other.id.0).collect::<Vec<_>>();
    assert_eq!(
        [ids(0), ids(1), ids(19), ids(20), ids(30), ids(40), ids(41)],
        [vec![1], vec![], vec![], vec![2], vec![2], vec![1, 2], vec![]]
    );
    let x_m = |k: usize| states[k].iter().find(|other| other.id.0 == 2).unwrap().movement.pose.x_m;
    assert_eq!([x_m(20), x_m(39), x_m(40)], [28.0, 28.0, 88.0]);
}

#[test]
fn bad_vehicles_are_errors_with_instant_and_name() {
    let cases: [(Vehicles, &str); 6] = [
        (
            Box::new(|_| Some(vec![one("x", 20.0, 0.0), one("x", 30.0, 0.0)])),
            "vehicle \"x\" of SUMO: expected one",
        ),
        (
            Box::new(|step| Some(vec![one("x", if step < 3 { 30.0 } else { f64::NAN }, 9.0)])),
            "expected a place",
        ),
        (Box::new(|step| Some(vec![one("x", 30.0, if step < 3 { 9.0 } else { 1e9 })])), "expected a place"),
        (
            Box::new(|step| Some(if step < 3 { Vec::new() } else { vec![one("in", 2.0, 0.0)] })),
            "vehicle \"in\" of SUMO: it appears inside the ego",
        ),
        (
            Box::new(|_| Some((0..10_000).map(|k| one(&format!("v{k}"), 1e4, f64::from(k))).collect())),
            "expected at most 2000 vehicles around the ego, found 10000",
        ),
        (Box::new(|step| (step < 3).then(Vec::new)), "closed the connection"),
    ];
    for (vehicles, expected) in cases {
        let error = run(vehicles, 100).unwrap_err();
        assert!(error.contains(expected), "{expected}: {error}");
    }
}

#[test]
fn vehicle_in_the_place_of_the_ego_is_removed_before_the_start() {
    // It stays where the peer does not do as it is asked: the ego then starts inside it, and contacts are the world's.
    let states = run(Box::new(|step| Some(vec![one("in", 2.0 + f64::from(step), 0.0)])), 1).unwrap();
    assert!(states[0].is_empty(), "{states:?}");
}

#[test]
fn silent_peer_is_an_error_after_the_timeout() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let stream = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
    let mut client = Client::new(stream, Duration::from_millis(200)).unwrap();
    assert_eq!(client.ask(crate::Command::version()), Err(SumoError::Silent(0)));
    drop(listener);
}

#[test]
fn length_of_a_message_is_limited() {
    for length in [0_u32, 3, u32::MAX] {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let stream = TcpStream::connect(listener.local_addr().unwrap()).unwrap();
        let mut client = Client::new(stream, Duration::from_secs(5)).unwrap();
        let (mut peer, _) = listener.accept().unwrap();
        peer.write_all(&length.to_be_bytes()).unwrap();
        let error = client.ask(crate::Command::version()).unwrap_err();
        assert!(matches!(&error, SumoError::Answer(why) if why.contains("a message of")), "{error}");
    }
}
