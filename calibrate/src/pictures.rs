//! From `photo` to `poses`: a pose names its picture, and what the picture showed is the pose's reading, with its own standard errors.

use crate::CalibrateError;
use crate::log::{MOST_BYTES, file_error, rows};
use crate::poses::PoseReading;
use krait_ipc::input;
use serde::Deserialize;
use std::path::Path;

/// Pictures that are named in a sentence; of more, their number.
const MOST_NAMED: usize = 6;

/// What `poses` reads of a row of [`crate::photo::table`]; an empty cell was not seen.
#[derive(Clone, Debug, Deserialize)]
struct PictureBend {
    image: String,
    b_x_rad: Option<f64>,
    b_y_rad: Option<f64>,
    sd_x_rad: Option<f64>,
    sd_y_rad: Option<f64>,
    /// The part of both that all pictures of a session share; an older table does not have it.
    #[serde(default)]
    base_sd_x_rad: Option<f64>,
    #[serde(default)]
    base_sd_y_rad: Option<f64>,
}

/// The bends of a table, and its name.
#[derive(Clone, Debug)]
pub(crate) struct Pictures {
    name: String,
    bends: Vec<PictureBend>,
}

impl Pictures {
    /// Reads a table; before the first clicks there is none.
    pub(crate) fn read(path: &Path) -> Result<Self, CalibrateError> {
        let name = path.display().to_string();
        let text = match input::text(path, MOST_BYTES) {
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => String::new(),
            read => read.map_err(|e| file_error(path, "read", &e))?,
        };
        let bends: Vec<PictureBend> = rows(path, &text)?;
        for (k, bend) in bends.iter().enumerate() {
            let reason = if bends[..k].iter().any(|other| other.image == bend.image) {
                format!("the picture {:?} is there twice", bend.image)
            } else if let Some(bad) = bend.numbers().into_iter().flatten().find(|v| !v.is_finite()) {
                format!("{bad} is no bend and no standard deviation")
            } else if [bend.sd_x_rad, bend.sd_y_rad].into_iter().flatten().any(|sd| !(sd > 1e-6 && sd < 0.2)) {
                "a standard deviation is out of range, expected 1e-6 to 0.2 rad".to_owned()
            } else if bend.parts().into_iter().flatten().any(|[own, base]| !(own > 0.0 && base >= 0.0)) {
                "the base's part of a standard deviation is out of range, expected 0 to less than that".to_owned()
            } else {
                continue;
            };
            return Err(CalibrateError::Row { file: name, row: k + 2, reason });
        }
        Ok(Self { name, bends })
    }

    /// Gives each reading that names a picture what the picture showed; of one side only where that is enough.
    pub(crate) fn give(&self, readings: &mut [PoseReading], front_only: bool) {
        for reading in readings {
            let own = self.bends.iter().find(|bend| Some(&bend.image) == reading.image.as_ref());
            let Some(own) = own else { continue };
            let [x, y] = own.parts();
            match (own.b_x_rad, own.b_y_rad, x, y) {
                (Some(b_x), _, Some([sd_x, base_x]), _) if front_only => {
                    (reading.b_x_rad, reading.b_y_rad) = (b_x, f64::NAN);
                    reading.sd_xy_rad = Some([sd_x, f64::NAN]);
                    reading.base_sd_xy_rad = Some([base_x, f64::NAN]);
                }
                (Some(b_x), Some(b_y), Some([sd_x, base_x]), Some([sd_y, base_y])) => {
                    (reading.b_x_rad, reading.b_y_rad) = (b_x, b_y);
                    reading.sd_xy_rad = Some([sd_x, sd_y]);
                    reading.base_sd_xy_rad = Some([base_x, base_y]);
                }
                _ => {}
            }
        }
    }

    /// What is said of readings whose pictures gave no bend; nothing where all did.
    pub(crate) fn waiting(&self, readings: &[PoseReading]) -> Option<String> {
        let none: Vec<&str> =
            readings.iter().filter(|r| r.sd_xy_rad.is_none()).filter_map(|r| r.image.as_deref()).collect();
        let (from_one_side, missing): (Vec<&str>, Vec<&str>) =
            none.into_iter().partition(|image| self.bends.iter().any(|bend| bend.image == *image));
        let mut said = Vec::new();
        if !missing.is_empty() {
            said.push(format!(
                "{} are not in {} yet: click them, then `krait calibrate photo CLICKS --out {}`, then this command again",
                named(&missing),
                self.name,
                self.name
            ));
        }
        if !from_one_side.is_empty() {
            said.push(format!(
                "{} were seen from one side only and are left out: a pose needs the front and the side, or a mirror (or --front from the first pose on)",
                named(&from_one_side)
            ));
        }
        (!said.is_empty()).then(|| said.join("; "))
    }
}

impl PictureBend {
    fn numbers(&self) -> [Option<f64>; 6] {
        let Self { b_x_rad, b_y_rad, sd_x_rad, sd_y_rad, base_sd_x_rad, base_sd_y_rad, .. } = *self;
        [b_x_rad, b_y_rad, sd_x_rad, sd_y_rad, base_sd_x_rad, base_sd_y_rad]
    }

    /// Of each component's standard deviation what is the picture's own, and what the base makes. Where a table does not say, both may be
    /// all of it.
    fn parts(&self) -> [Option<[f64; 2]>; 2] {
        let of = |sd: Option<f64>, base: Option<f64>| {
            let sd = sd?;
            Some(base.map_or([sd, sd], |base| [(sd * sd - base * base).max(0.0).sqrt(), base]))
        };
        [of(self.sd_x_rad, self.base_sd_x_rad), of(self.sd_y_rad, self.base_sd_y_rad)]
    }
}

fn named(images: &[&str]) -> String {
    let shown = images.iter().take(MOST_NAMED).copied().collect::<Vec<_>>().join(", ");
    match images.len().checked_sub(MOST_NAMED) {
        Some(n) if n > 0 => format!("the pictures {shown} and {n} more"),
        _ => format!("the pictures {shown}"),
    }
}
