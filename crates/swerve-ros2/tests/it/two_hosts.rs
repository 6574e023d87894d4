//! Two hosts on one network: two network namespaces of this machine, joined by a virtual cable.
//!
//! Needs Linux, `ip` (Debian `iproute2`) and the right to create namespaces; skipped with a notice otherwise, as in
//! many containers.

#![expect(clippy::unwrap_used, reason = "all of this is a test")]

use std::process::{Child, Command, Stdio};
use std::time::Duration;

use swerve_ros2::bridge::{Bridge, Direction, Endpoint, EndpointId, Options};
use swerve_ros2::env::Network;
use swerve_ros2::mapping::{Mapping, Qos, Side, Vehicle};
use swerve_ros2::samples::{large_cloud, sample};
use swerve_ros2::{AnyMessage, Kind};

/// Path of the test of this file, which also runs inside the namespaces.
const NAME: &str = "two_hosts::two_hosts_on_one_network_find_each_other";

/// Set in the processes inside the namespaces: the role of the host.
const ROLE: &str = "SWERVE_TWO_HOSTS";
const PATIENCE: Duration = Duration::from_secs(20);

fn ip(arguments: &str) -> bool {
    let status =
        Command::new("ip").args(arguments.split(' ')).stdout(Stdio::null()).stderr(Stdio::null()).status();
    status.is_ok_and(|status| status.success())
}

/// The two namespaces, deleted on drop.
struct Hosts([String; 2]);

impl Hosts {
    fn new() -> Option<Self> {
        let pid = std::process::id();
        let hosts = Self(["a", "b"].map(|host| format!("swerve-{host}-{pid}")));
        let [a, b] = &hosts.0;
        let made = ip(&format!("netns add {a}"))
            && ip(&format!("netns add {b}"))
            && ip(&format!("link add va{pid} netns {a} type veth peer name vb{pid} netns {b}"));
        let up = |host: &str, link: &str, address: &str| {
            ip(&format!("-n {host} addr add {address}/24 dev {link}"))
                && ip(&format!("-n {host} link set lo up"))
                && ip(&format!("-n {host} link set {link} up"))
        };
        let ready =
            made && up(a, &format!("va{pid}"), "10.77.0.1") && up(b, &format!("vb{pid}"), "10.77.0.2");
        ready.then_some(hosts)
    }

    /// Runs this test again on one of the hosts, in one of the roles.
    fn run(&self, host: usize, role: &str) -> Child {
        Command::new("ip")
            .args(["netns", "exec", &self.0[host]])
            .arg(std::env::current_exe().unwrap())
            .args([NAME, "--exact", "--include-ignored", "--nocapture"])
            .env(ROLE, role)
            .stdout(Stdio::piped())
            .spawn()
            .unwrap()
    }
}

impl Drop for Hosts {
    fn drop(&mut self) {
        for host in &self.0 {
            ip(&format!("netns del {host}"));
        }
    }
}

const KINDS: [Kind; 2] = [Kind::Control, Kind::PointCloud2];

fn bridge(node: &str, ways: [&str; 2]) -> Bridge {
    let network = Network { domain: 42, localhost_only: false };
    let endpoints = KINDS.iter().flat_map(|kind| {
        [(ways[0], Direction::Send), (ways[1], Direction::Receive)].map(|(way, direction)| Endpoint {
            name: format!("{way}/{kind}"),
            topic: format!("/hosts/{way}/{}", kind.name()),
            kind: *kind,
            qos: Qos::DEFAULT,
            direction,
            rate_max_hz: None,
        })
    });
    let mapping = Mapping::of(Vehicle::Plain, network);
    let options = Options {
        node: node.to_owned(),
        endpoints: endpoints.collect(),
        ..Options::from_mapping(&mapping, Side::Stack)
    };
    Bridge::start(&options).unwrap()
}

/// Echoes messages until killed.
fn answer() {
    let bridge = bridge("answer", ["back", "there"]);
    for _ in 0..600 {
        bridge.wait(Duration::from_millis(100));
        while let Some((EndpointId(id), received)) = bridge.take_any() {
            bridge.publish(EndpointId(id - 1), received.message).unwrap();
        }
    }
}

fn ask() {
    let bridge = bridge("ask", ["there", "back"]);
    for id in 0..2 * KINDS.len() {
        assert!(bridge.wait_matched(EndpointId(id), 1, PATIENCE), "the other host was not found");
    }
    let cloud = AnyMessage::PointCloud2(large_cloud(65_536 / 18));
    for (i, message) in [sample(Kind::Control), cloud].into_iter().enumerate() {
        let back = (0..20).find_map(|_| {
            bridge.publish(EndpointId(2 * i), message.clone()).unwrap();
            bridge.wait(Duration::from_millis(500));
            bridge.take(EndpointId(2 * i + 1))
        });
        assert_eq!(back.map(|received| received.message), Some(message));
    }
}

#[test]
#[ignore = "two hosts: network namespaces"]
fn two_hosts_on_one_network_find_each_other() {
    match std::env::var(ROLE).as_deref() {
        Ok("answer") => return answer(),
        Ok(_) => return ask(),
        Err(_) => {}
    }
    let Some(hosts) = Hosts::new() else {
        swerve_tests::skipped("no `ip`, or no right to make network namespaces");
        return;
    };
    let mut answer = hosts.run(1, "answer");
    let asked = hosts.run(0, "ask").wait_with_output().unwrap();
    let _ = answer.kill();
    let _ = answer.wait();
    let output = String::from_utf8_lossy(&asked.stdout);
    assert!(asked.status.success() && output.contains("1 passed"), "{output}");
}
