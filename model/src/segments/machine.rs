//! The constants that follow from the segments' parameters, computed once, and the kinematics of the lines.

use super::{
    Bends, BendsByLines, LineValues, LinesByBends, MAX_LINES, MAX_SEGMENTS, SegmentsError, SegmentsParameters,
};
use core::f64::consts::PI;
use nalgebra::Vector2;

/// Checked segments; every formula of the model is a method of them.
#[derive(Clone, Debug, PartialEq)]
pub struct Segments {
    pub(super) n: usize,
    pub(super) n_lines: usize,
    /// The segment at whose disk each line ends, from 0.
    pub(super) of_line: [usize; MAX_LINES],
    pub(super) l_m: [f64; MAX_SEGMENTS],
    /// E I of each primary backbone and of each line, N m2.
    pub(super) primary_nm2: [f64; MAX_SEGMENTS],
    pub(super) line_nm2: [f64; MAX_LINES],
    /// L_j/(E A_j): what a segment's primary backbone gives along itself, m/N; zero where the lines are taken for rigid.
    pub(super) axial_m_per_n: [f64; MAX_SEGMENTS],
    /// 1/(E A) of each line, 1/N; zero where the lines are taken for rigid.
    pub(super) give_per_n: [f64; MAX_LINES],
    /// 1/K_d and 1/K_c of each line, m/N; zero where the lines are taken for rigid.
    pub(super) c_d_m_per_n: LineValues,
    pub(super) c_c_m_per_n: LineValues,
    pub(super) phi_rad: f64,
    /// Bend at which the widest backbone in each segment reaches the strain limit, rad.
    pub(super) max_bend_rad: [f64; MAX_SEGMENTS],
    pub(super) rows: [Vector2<f64>; MAX_LINES],
    j: LinesByBends,
    pinv: BendsByLines,
}

impl Segments {
    /// Checks the parameters and derives the constants.
    ///
    /// # Errors
    /// [`SegmentsError`] as [`SegmentsParameters::check`].
    pub fn new(parameters: &SegmentsParameters) -> Result<Self, SegmentsError> {
        parameters.check()?;
        let give = if parameters.rigid_lines { 0.0 } else { 1.0 };
        let mut own = Self {
            n: parameters.segments.len(),
            n_lines: 0,
            of_line: [0; MAX_LINES],
            l_m: [0.0; MAX_SEGMENTS],
            primary_nm2: [0.0; MAX_SEGMENTS],
            line_nm2: [0.0; MAX_LINES],
            axial_m_per_n: [0.0; MAX_SEGMENTS],
            give_per_n: [0.0; MAX_LINES],
            c_d_m_per_n: LineValues::zeros(),
            c_c_m_per_n: LineValues::zeros(),
            phi_rad: parameters.phi_rad,
            max_bend_rad: [0.0; MAX_SEGMENTS],
            rows: [Vector2::zeros(); MAX_LINES],
            j: LinesByBends::zeros(),
            pinv: BendsByLines::zeros(),
        };
        for (idx, segment) in parameters.segments.iter().enumerate() {
            let bending_nm2 = segment.e_pa * PI / 64.0 * (segment.d_outer_m.powi(4) - segment.d_inner_m.powi(4));
            let per_n = give / segment.axial_stiffness_n();
            own.l_m[idx] = segment.l_m;
            own.primary_nm2[idx] = bending_nm2;
            own.axial_m_per_n[idx] = segment.l_m * per_n;
            let widest_m = parameters.segments[idx..].iter().fold(0.0_f64, |most, own| most.max(own.d_outer_m));
            own.max_bend_rad[idx] = parameters.settings.strain_limit * 2.0 * segment.l_m / widest_m;
            for line in &segment.lines {
                let k = own.n_lines;
                let (sin, cos) = line.azimuth_rad.sin_cos();
                own.rows[k] = Vector2::new(-cos, sin) * line.radius_m;
                (own.of_line[k], own.line_nm2[k], own.give_per_n[k]) = (idx, bending_nm2, per_n);
                (own.c_d_m_per_n[k], own.c_c_m_per_n[k]) = (segment.l_d_m * per_n, segment.l_c_m * per_n);
                for j in 0..=idx {
                    (own.j[(k, 2 * j)], own.j[(k, 2 * j + 1)]) = (own.rows[k].x, own.rows[k].y);
                }
                own.n_lines += 1;
            }
        }
        let normal = own.padded(own.j.transpose() * own.j);
        // The lines of no segment lie in one plane, so the columns are independent.
        let inverse = normal.try_inverse().ok_or(SegmentsError::Lines { found: own.n_lines })?;
        own.pinv = inverse * own.j.transpose();
        Ok(own)
    }

    /// How many segments there are.
    pub fn n(&self) -> usize {
        self.n
    }

    /// How many lines there are in all.
    pub fn n_lines(&self) -> usize {
        self.n_lines
    }

    /// Components of the bend vectors.
    pub fn n_bends(&self) -> usize {
        2 * self.n
    }

    /// The segment at whose disk a line ends, both from 0.
    pub fn segment_of(&self, line: usize) -> usize {
        self.of_line[line]
    }

    /// Where a line crosses the disk of its own segment and of each before it, x and y of the disk, m.
    pub fn line_in_disk_m(&self, line: usize) -> Vector2<f64> {
        Vector2::new(-self.rows[line].x, self.rows[line].y)
    }

    /// Length of a segment's primary backbone, m.
    pub fn l_m(&self, segment: usize) -> f64 {
        self.l_m[segment]
    }

    /// Bend at which the widest backbone in a segment reaches the strain limit, rad.
    pub fn max_bend_rad(&self, segment: usize) -> f64 {
        self.max_bend_rad[segment]
    }

    /// 1/K_d + 1/K_c of a line without friction, m/N.
    pub fn frictionless_compliance_m_per_n(&self, line: usize) -> f64 {
        self.c_d_m_per_n[line] + self.c_c_m_per_n[line]
    }

    /// J = d q / d bends, m/rad: constant, block lower triangular.
    pub fn j(&self) -> &LinesByBends {
        &self.j
    }

    /// J+ = (J^T J)^-1 J^T, rad/m: constant.
    pub fn pinv(&self) -> &BendsByLines {
        &self.pinv
    }

    /// Displacements q of the lines, m, push positive.
    pub fn q_m(&self, bends_rad: &Bends) -> LineValues {
        self.j * bends_rad
    }

    /// Bends, rad, that fit displacements, m, best.
    pub fn bends_from_q(&self, q_m: &LineValues) -> Bends {
        self.pinv * q_m
    }

    /// The bend vector of a segment.
    pub(super) fn bend(&self, bends_rad: &Bends, segment: usize) -> Vector2<f64> {
        Vector2::new(bends_rad[2 * segment], bends_rad[2 * segment + 1])
    }

    /// The lines that run in a segment: its own and all of those behind it.
    pub(super) fn passing(&self, segment: usize) -> impl Iterator<Item = usize> + use<'_> {
        (0..self.n_lines).filter(move |&k| self.of_line[k] >= segment)
    }

    /// What each line has inside the snake, m: the sum of L_j + J_k b_j over the segments that it passes.
    pub(super) fn inside_m(&self, q_m: &LineValues) -> LineValues {
        let mut length_m = *q_m;
        for k in 0..self.n_lines {
            length_m[k] += self.l_m[..=self.of_line[k]].iter().sum::<f64>();
        }
        length_m
    }

    /// A square matrix over the bends with ones where a segment that is not there has its diagonal, so that it can be inverted.
    pub(super) fn padded(&self, mut matrix: super::BendsByBends) -> super::BendsByBends {
        for k in self.n_bends()..super::MAX_BENDS {
            matrix[(k, k)] = 1.0;
        }
        matrix
    }
}
