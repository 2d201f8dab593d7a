//! Scripts: interpolated as documented, and every wrong field refused by line and column.

use krait_master::Script;

const HEAD: &str = "time_s,tip_vx_m_per_s,tip_vy_m_per_s,tip_vz_m_per_s,operator_present,clutch\n";

fn script(rows: &str) -> Script {
    Script::parse("s.csv", format!("{HEAD}{rows}").as_bytes()).expect("script")
}

fn refused(text: &str) -> String {
    Script::parse("s.csv", text.as_bytes()).expect_err("refused").to_string()
}

#[test]
fn velocity_is_interpolated_and_flags_hold() {
    let script = script("# comment\n\n1, 0, 0, 0, 1, 0\r\n2, 0.02, -0.04, 0, 1, 1\n3,0,0,0,0,0\n");
    let before = script.at(999_999_999).expect("before the first row");
    assert!(before.tip_vel_in_view_m_per_s == [0.0; 3] && !before.is_present, "nothing moves before the first row");
    let half = script.at(1_500_000_000).expect("between rows");
    assert_eq!(half.tip_vel_in_view_m_per_s, [0.01, -0.02, 0.0]);
    assert!(half.is_present && !half.is_clutched, "flags hold from their row");
    assert!(script.at(2_999_999_999).expect("just before the last").is_clutched);
    assert!(!script.at(3_000_000_000).expect("the last row itself").is_present);
    assert!(script.at(3_000_000_001).is_none(), "ended");
    assert_eq!(script.duration_ns(), 3_000_000_000);
}

#[test]
fn the_flag_columns_may_be_absent() {
    let text = b"time_s,tip_vx_m_per_s,tip_vy_m_per_s,tip_vz_m_per_s\n0,0.01,0,0\n";
    let sample = Script::parse("s.csv", text).expect("script").at(0).expect("row");
    assert!(sample.is_present && !sample.is_clutched);
}

#[test]
fn a_jaw_is_asked_to_open_or_close_from_its_row_on_and_anything_else_is_refused() {
    let head = HEAD.trim_end();
    let script =
        Script::parse("s.csv", format!("{head},jaw\n0,0,0,0,1,0,1\n1,0,0,0,1,0,-1\n2,0,0,0,1,0,0\n").as_bytes());
    let script = script.expect("script");
    let asked = [500_000_000, 1_500_000_000, 2_000_000_000].map(|ns| script.at(ns).expect("a row").jaw);
    assert_eq!(asked, [1, -1, 0]);
    let wrong = refused(&format!("{head},jaw\n0,0,0,0,1,0,0.5\n"));
    assert!(wrong.contains("line 2, column 7: expected -1 (close), 0 or 1 (open), found \"0.5\""), "{wrong}");
}

#[test]
fn a_hand_that_turns_has_three_columns_more() {
    let head = "time_s,tip_vx_m_per_s,tip_vy_m_per_s,tip_vz_m_per_s,tip_wx_rad_per_s,tip_wy_rad_per_s,tip_wz_rad_per_s";
    let text = format!("{head},operator_present,clutch\n0,0.01,0,0,0,0,0,1,0\n2,0,0,0.02,0.5,-1,4,1,1\n");
    let half = Script::parse("s.csv", text.as_bytes()).expect("script").at(1_000_000_000).expect("row");
    assert_eq!(half.tip_vel_in_view_m_per_s, [0.005, 0.0, 0.01]);
    assert_eq!(half.tip_angular_vel_in_view_rad_per_s, [0.25, -0.5, 2.0]);
    assert!(half.is_present && !half.is_clutched);
    let short = Script::parse("s.csv", format!("{head}\n0,0,0,0,0,0,3\n").as_bytes()).expect("script");
    let row = short.at(0).expect("row");
    assert!(row.is_present && row.tip_angular_vel_in_view_rad_per_s == [0.0, 0.0, 3.0]);
    let wild = refused(&format!("{head}\n0,0,0,0,0,11,0\n"));
    assert!(
        wild.contains("line 2, column 6: expected an angular velocity from -10 to 10 rad/s, found \"11\""),
        "{wild}"
    );
    let one = refused("time_s,tip_vx_m_per_s,tip_vy_m_per_s,tip_vz_m_per_s,tip_wx_rad_per_s\n");
    assert!(one.contains("line 1, column 6: expected the heading tip_wy_rad_per_s, found nothing"), "{one}");
}

#[test]
fn a_wrong_field_is_named_by_line_and_column() {
    for (rows, named) in [
        (
            "0,0,0,0,1,0\n1,x,0,0,1,0\n",
            "script s.csv, line 3, column 2: expected a velocity from -0.1 to 0.1 m/s, found \"x\"",
        ),
        ("0,0,0,NaN,1,0\n", "line 2, column 4: expected a velocity"),
        ("0,0,inf,0,1,0\n", "line 2, column 3: expected a velocity"),
        ("0,0.11,0,0,1,0\n", "line 2, column 2: expected a velocity"),
        ("-1,0,0,0,1,0\n", "line 2, column 1: expected a time from 0"),
        ("0,0,0,0,2,0\n", "line 2, column 5: expected 0 or 1, found \"2\""),
        ("0,0,0,0,1,\n", "line 2, column 6: expected 0 or 1, found \"\""),
        ("1,0,0,0,1,0\n1,0,0,0,1,0\n", "line 3, column 1: expected a time after 1 s, found 1 s"),
        ("0,0,0,0\n", "line 2, column 4: expected 6 fields as in the heading, found 4"),
        ("0,0,0,0,1,0,9\n", "line 2, column 6: expected 6 fields as in the heading, found 7"),
        ("", "line 2, column 1: expected a header and at least one row"),
    ] {
        let sentence = refused(&format!("{HEAD}{rows}"));
        assert!(sentence.contains(named), "{sentence}\nshould contain {named}");
    }
    assert!(refused("time_s,vx\n").contains("line 1, column 2: expected the heading tip_vx_m_per_s, found \"vx\""));
    assert!(refused("time_s,tip_vx_m_per_s\n").contains("line 1, column 3: expected the heading tip_vy_m_per_s"));
    assert!(refused("\u{7f}ELF\u{0}").contains("line 1, column 1: expected the heading time_s"));
}
