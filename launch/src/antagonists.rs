//! Groups of antagonists must be lines that can hold each other in the machine of the model.
//!
//! Problem: where a line has let go the others of its group give way to it, which is right only where these others hold it.
//!
//! Intuition: each line pulls the bends in a direction of its own, a row of J = d q / d b. Lines hold each other where some pulls of
//! all of them cancel: sum of lambda_k J_k = 0 with every lambda_k > 0.
//!
//! How: least squares of that sum with lambda_k >= 1 on directions of length 1, one lambda after the other. The scale is free, so 1 is
//! any pull. What is left of the pulls says which line nobody holds.
//!
//! Failure: lines whose pulls cancel but for [`SLACK`] of them pass, because measured azimuths are not exact.

use anyhow::bail;
use krait_bridge::LiveModel;
use krait_model::Snake;
use krait_slave::DriveConfig;
use nalgebra::DVector;

/// Pulls may leave this part of their sum.
const SLACK: f64 = 0.02;
/// Far more than twelve lines take.
const SWEEPS: usize = 5000;

/// Checks the groups that a configuration names, if it names any. Its lines must be as many as the model's.
///
/// # Errors
/// One sentence that names a group and the line that no other holds.
pub(crate) fn check(drive: &DriveConfig, machine: &LiveModel) -> anyhow::Result<()> {
    if !drive.names_groups() {
        return Ok(());
    }
    let rows = rows(machine)?;
    let groups = drive.groups();
    for k in 0..drive.n_together() {
        let members: Vec<usize> = (0..drive.n_together()).filter(|j| groups[*j] == groups[k]).collect();
        if members[0] != k || members.len() < 2 {
            continue;
        }
        let pulls: Vec<DVector<f64>> = members.iter().filter_map(|j| rows.get(*j)).map(unit).collect();
        if let Some(at) = unheld(&pulls) {
            let names: Vec<String> = members.iter().map(|j| (j + 1).to_string()).collect();
            bail!(
                "[slave.drive] group = {}: actuators {} cannot hold each other in the machine of the model, expected lines whose pulls \
                 can cancel, found that nobody of them pulls against actuator {}; give those that do the same group, and one that \
                 has nobody a group of its own",
                groups[k],
                names.join(", "),
                members[at] + 1
            );
        }
    }
    Ok(())
}

/// Of each actuator, how it moves with each bend.
fn rows(machine: &LiveModel) -> anyhow::Result<Vec<DVector<f64>>> {
    Ok(match machine {
        LiveModel::Snake(chain) => {
            let j_q_bend = Snake::new(chain.machine())?.j_q_bend();
            j_q_bend.row_iter().map(|row| DVector::from_iterator(row.len(), row.iter().copied())).collect()
        }
        LiveModel::Segments(segments) => {
            let machine = segments.chain().machine();
            let n_bends = machine.n_bends();
            let row = |k: usize| DVector::from_iterator(n_bends, machine.j().row(k).iter().take(n_bends).copied());
            (0..machine.n_lines()).map(row).collect()
        }
        // One actuator moves one joint, both ways.
        LiveModel::Joints(joints) => {
            (0..joints.n()).map(|k| DVector::from_fn(joints.n(), |j, _| f64::from(u8::from(j == k)))).collect()
        }
    })
}

/// A direction of length 1; one that moves nothing stays.
fn unit(row: &DVector<f64>) -> DVector<f64> {
    row.try_normalize(0.0).unwrap_or_else(|| row.clone())
}

/// Which of these pulls of length 1 the others cannot hold, if there is one: the one that points most where the sum is left.
fn unheld(pulls: &[DVector<f64>]) -> Option<usize> {
    let n = pulls.first()?.len();
    let mut lambda = vec![1.0; pulls.len()];
    let mut left = pulls.iter().fold(DVector::zeros(n), |sum, pull| sum + pull);
    for _ in 0..SWEEPS {
        for (own, pull) in lambda.iter_mut().zip(pulls) {
            let change = (*own - pull.dot(&left)).max(1.0) - *own;
            *own += change;
            left.axpy(change, pull, 1.0);
        }
    }
    let allowed = SLACK * lambda.iter().sum::<f64>();
    if left.norm() <= allowed {
        return None;
    }
    (0..pulls.len()).max_by(|a, b| pulls[*a].dot(&left).total_cmp(&pulls[*b].dot(&left)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use krait_model::model_file::{ModelFile, built_in};
    use krait_slave::ActuatorConfig;

    fn at(degrees: &[f64]) -> Vec<DVector<f64>> {
        degrees.iter().map(|d| DVector::from_vec(vec![d.to_radians().cos(), d.to_radians().sin()])).collect()
    }

    #[test]
    fn lines_hold_each_other_where_pulls_of_all_of_them_cancel() {
        for held in
            [&[0.0, 120.0, 240.0][..], &[10.0, 190.0], &[0.0, 90.0, 180.0, 270.0], &[0.0, 179.5], &[0.0, 100.0, 185.0]]
        {
            assert_eq!(unheld(&at(held)), None, "{held:?}");
        }
        for (loose, expected) in
            [(&[0.0, 120.0][..], None), (&[0.0, 180.0, 90.0], Some(2)), (&[0.0, 30.0, 60.0], Some(1))]
        {
            let found = unheld(&at(loose));
            assert!(found.is_some() && expected.is_none_or(|expected| found == Some(expected)), "{loose:?}: {found:?}");
        }
    }

    fn said(model: &str, groups: &[u32]) -> Result<(), String> {
        let machine = LiveModel::of(&ModelFile::parse(model).unwrap()).unwrap();
        let actuator =
            groups.iter().map(|group| ActuatorConfig { group: *group, ..ActuatorConfig::default() }).collect();
        let drive = DriveConfig { actuator, ..DriveConfig::default() };
        check(&drive, &machine).map_err(|error| error.to_string())
    }

    #[test]
    fn groups_of_a_snake_of_segments_and_of_joints_are_checked_and_none_named_is_none_claimed() {
        let snake = built_in("estimated").unwrap();
        for good in [&[1, 1, 1][..], &[5, 5, 5], &[1, 2, 3]] {
            assert_eq!(said(snake, good), Ok(()), "{good:?}");
        }
        let sentence = said(snake, &[1, 2, 2]).unwrap_err();
        assert!(sentence.starts_with("[slave.drive] group = 2: actuators 2, 3 cannot hold each other"), "{sentence}");

        let segments = include_str!("../../docs/segments/two.toml");
        for good in [&[1; 6][..], &[1, 1, 1, 2, 2, 2], &[1, 1, 1, 4, 5, 6]] {
            assert_eq!(said(segments, good), Ok(()), "{good:?}");
        }
        let sentence = said(segments, &[1, 1, 2, 2, 2, 2]).unwrap_err();
        assert!(sentence.contains("group = 1: actuators 1, 2 "), "{sentence}");
        let sentence = said(segments, &[1, 1, 1, 1, 2, 2]).unwrap_err();
        assert!(
            sentence.contains("group = 1: actuators 1, 2, 3, 4 ") && sentence.contains("actuator 4;"),
            "{sentence}"
        );

        let joints = include_str!("../../docs/joints/wrist.toml");
        assert_eq!((said(joints, &[1; 3]), said(joints, &[1, 2, 3])), (Ok(()), Ok(())));
        assert!(said(joints, &[1, 2, 2]).unwrap_err().contains("actuators 2, 3 "));
    }
}
