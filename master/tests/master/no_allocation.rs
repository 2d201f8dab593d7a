//! The master's step allocates nothing, whatever arrives: counted, not believed.

use crate::allocations::allocations_of;
use krait_ipc::message::DriveWish;
use krait_master::{Engage, HidRecording, MasterConfig, MasterCore, PosePacket, RawReport, ScriptSample};

#[test]
fn no_report_tick_or_event_allocates() {
    let recording = HidRecording::shipped().expect("built in");
    let mut core = MasterCore::new(&MasterConfig { engage: Engage::Once, ..MasterConfig::default() }).expect("default");
    let mut pad =
        MasterCore::with_pad(&MasterConfig { engage: Engage::Once, ..MasterConfig::default() }).expect("default");
    let mut pose =
        MasterCore::with_pose(&MasterConfig { engage: Engage::Once, ..MasterConfig::default() }).expect("default");
    let mut joined =
        MasterCore::new(&MasterConfig { engage: Engage::Once, ..MasterConfig::default() }).expect("default");
    let (push, rest, press, let_go) = ([1, 200, 0, 0, 0, 0, 0], [1, 0, 0, 0, 0, 0, 0], [3, 1, 0], [3, 0, 0]);
    let sender = std::net::SocketAddr::from(([127, 0, 0, 1], 1));
    let mut n_moving = 0;
    let n = allocations_of(|| {
        for (stamp_ns, bytes) in recording.reports() {
            std::hint::black_box(core.on_report(bytes, stamp_ns)).expect("report");
            n_moving += u32::from(core.on_tick(stamp_ns).tip_vel_in_view_m_per_s != [0.0; 3]);
            std::hint::black_box(core.on_report(RawReport::clipped(&[9; 70]).as_bytes(), stamp_ns))
                .expect_err("refused");
        }
        core.on_unplugged();
        core.on_plugged();
        core.on_drained(3);
        core.on_script(ScriptSample {
            tip_vel_in_view_m_per_s: [0.01; 3],
            tip_angular_vel_in_view_rad_per_s: [0.1; 3],
            is_present: true,
            is_clutched: false,
            jaw: 1,
        });
        std::hint::black_box(core.on_tick(i64::MAX));
        for frame in 1..500 {
            let (sequence, sample_ns, flags) = (frame, frame as i64 * 20_000_000, u32::from(frame % 100 != 1));
            let deflection_permille = [(frame as i32 % 90) * 20, 0];
            let wish = DriveWish { sequence, sample_ns, page: 1, frame, sender_pid: 7, flags, deflection_permille };
            std::hint::black_box(pad.on_pad(&wish, sample_ns).is_ok());
            n_moving += u32::from(pad.on_tick(sample_ns).tip_vel_in_view_m_per_s != [0.0; 3]);
        }
        for step in 0..500_i32 {
            let (now_ns, closed) = (i64::from(step) * 2_000_000, f64::from(u8::from(step % 100 > 5)));
            let packet = PosePacket {
                gripper: closed,
                position: [f64::from(step) * 1e-4, 0.0, 0.0],
                orientation: [1.0, 0.0, 0.0, 0.0],
            };
            std::hint::black_box(pose.on_packet(&packet.encode(), sender, now_ns).is_ok());
            std::hint::black_box(pose.on_packet(&[0; 80], sender, now_ns)).expect_err("refused");
            n_moving += u32::from(pose.on_tick(now_ns).tip_vel_in_view_m_per_s != [0.0; 3]);
        }
        pose.on_unplugged();
        pose.on_restarted();
        for round in 0..200_i64 {
            let (now_ns, lost) = (round * 50_000_000, round as usize % 3);
            for (step, (device, bytes)) in
                (1..).zip([(0, &rest[..]), (1, &let_go[..]), (1, &press), (2, &push), (0, &push), (3, &[9])])
            {
                std::hint::black_box(joined.on_report_of(device, bytes, now_ns + step).is_ok());
            }
            n_moving += u32::from(joined.on_tick(now_ns + 10).tip_vel_in_view_m_per_s != [0.0; 3]);
            joined.on_unplugged_of(lost);
            std::hint::black_box(joined.on_tick(now_ns + 11));
            joined.on_plugged_of(lost);
            std::hint::black_box(joined.counts());
        }
        core.on_ended();
        std::hint::black_box(core.on_tick(i64::MAX));
    });
    assert_eq!(n, 0);
    assert!(n_moving > 1600, "the way through the operator's mapping was taken {n_moving} times");
}
