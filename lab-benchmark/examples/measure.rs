//! scratch
#![allow(clippy::all, clippy::pedantic, clippy::print_stdout, clippy::unwrap_used)]
use krait_lab_benchmark::benchmark::*;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let (machine, seed, rounds, groups, out) = (&a[1], a[2].parse().unwrap(), a[3].parse().unwrap(), a[4].clone(), &a[5]);
    let secs = a.get(6).map_or(100.0, |s| s.parse().unwrap());
    let most: usize = a.get(7).map_or(100000, |s| s.parse().unwrap());
    let all = if machine == "joints" { joint_grid(seed, rounds, secs) } else { grid(seed, rounds, secs) };
    let mut count = std::collections::BTreeMap::new();
    let cells: Vec<Cell> = all.into_iter().filter(|c| groups == "all" || groups.split(',').any(|g| g == c.group.word()))
        .filter(|c| { let n: &mut usize = count.entry(c.group.word()).or_default(); *n += 1; *n <= most }).collect();
    let options = Options { seed, seconds: secs, with_baselines: false };
    let outcomes = run(&options, &cells, std::path::Path::new(out), |_, _, o| {
        let (t, s) = match (&o.truth, &o.said) { (Some(t), Some(s)) => (t, s), _ => { println!("REFUSED {} {:?}", o.id, o.refused); return } };
        println!("{:8} {} {:32} {:13} {:6} -> {:8} {:?} p={:?} fin {:.3} floor {:?} noise {:.3} {:.1}s", o.group, if o.asserts_wrongly() {"W"} else if o.is_exact() {"E"} else {"."}, t.kind, t.noise, t.traj, s.verdict, s.named, s.structured, s.final_deg, s.floor_deg.map(|f| (f*1000.0).round()/1000.0), t.noise_rms_deg, o.seconds);
    }).unwrap();
    let s = Summary::new(&outcomes);
    let p = |n: &str, r: Rate| println!("{n:40} {:5.1} %  {:.0}-{:.0}  {} of {}", 100.0*r.rate, 100.0*r.low, 100.0*r.high, r.n, r.of);
    for (k, r) in &s.false_alarms { p(&format!("false alarm {k}"), *r); }
    p("right none", s.right_none);
    p("single exact", s.single_exact); p("single top1", s.top_1); p("pairs exact", s.pairs_exact);
    p("several exact", s.several_exact); p("several recall", s.several_recall); p("several precision", s.several_precision);
    p("beside right", s.beside_right); p("beside wrong", s.beside_wrong);
    p("outside asserted", s.outside_asserted); p("outside missing", s.outside_claimed); p("coverage", s.coverage);
}
