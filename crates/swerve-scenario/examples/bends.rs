use swerve_scenario::*;
fn main() {
    for file in std::env::args().skip(1) {
        let s = Scenario::read(std::path::Path::new(&file)).unwrap();
        let route = s.road.route();
        println!("route {file} {} start {:.0} end {:.0}", s.name, s.ego.s_m, s.ego.end_m);
        let mut s_m = s.ego.s_m;
        // stretches
        for st in route.stretches() {
            println!("  stretch from {:.1} junction {} limit {:?} turn", st.begin_m, st.in_junction, st.speed_limit_mps.map(|v| (v*3.6).round()));
        }
        let mut run: Option<(f64, f64, f64)> = None;
        while s_m < s.ego.end_m {
            let h0 = route.line().at(s_m - 1.0).pose.heading_rad; let h1 = route.line().at(s_m + 1.0).pose.heading_rad;
            let mut d = h1 - h0; while d > 3.14159 { d -= 6.28318 } while d < -3.14159 { d += 6.28318 }
            let k = d / 2.0;
            if k.abs() > 0.003 {
                let r = run.get_or_insert((s_m, k, 0.0)); if k.abs() > r.1.abs() { r.1 = k } r.2 += k * 1.0;
            } else if let Some((a, kmax, ang)) = run.take() {
                println!("  bend {:.0}..{:.0} radius {:.1} angle {:.0}", a, s_m, 1.0 / kmax, ang.to_degrees());
            }
            s_m += 1.0;
        }
        for a in &s.actors { if let Some(Trigger::Reaches { s_m, .. }) = a.trigger { let at = route.project(a.pose(&s.road.line()).point()); println!("  actor {} trigger {:.0} at {:.0} d {:.1}", a.name, s_m, at.s_m, at.d_m) } }
    }
}
