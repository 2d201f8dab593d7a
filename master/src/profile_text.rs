//! Writes a profile as the text that a person reads and corrects, and makes one for a device that has none.

use crate::evdev_names::{axis_name, button_name};
use crate::profile_signs::text_of;
use crate::{AXIS_NAMES, AxisFrom, AxisPlace, InputDevice, Profile, ProfileAxis, ProfileDevice};
use std::path::Path;

impl Profile {
    /// The profile of an input device as it names its own axes: `ABS_X` is the hand's x, and so on to `ABS_RZ`; other axes and
    /// all buttons are left out. `node` stands for a device of which the kernel says nothing.
    pub fn of_input(device: Option<&InputDevice>, node: &Path, axes: &[u16]) -> Self {
        let axes = axes.iter().filter_map(|&code| {
            let axis_idx = usize::from(code);
            let from = AxisFrom::Place(AxisPlace::of(code));
            (axis_idx < AXIS_NAMES.len()).then_some(ProfileAxis { axis_idx, is_negated: false, from })
        });
        let (name, whose) = match device {
            Some(device) => (device.name.clone(), ProfileDevice::Id(device.vendor_id, device.product_id)),
            None => (node.display().to_string(), ProfileDevice::Path(node.to_owned())),
        };
        Self {
            name,
            device: whose,
            axes: axes.collect(),
            buttons: Vec::new(),
            release: None,
            lights: Vec::new(),
            rumble: Vec::new(),
        }
    }

    /// The profile as the text that [`Profile::parse`] reads.
    pub fn to_text(&self) -> String {
        let quoted = |text: &str| toml::Value::String(text.to_owned()).to_string();
        let mut text = format!("name = {}\n", quoted(&self.name));
        text += &match &self.device {
            ProfileDevice::Id(vendor_id, product_id) => format!("id = \"{vendor_id:04x}:{product_id:04x}\"\n"),
            ProfileDevice::Path(path) => format!("path = {}\n", quoted(&path.to_string_lossy())),
            ProfileDevice::Unnamed => String::new(),
        };
        if let Some(key) = self.release {
            text += &format!("release = \"{}\"\n", button_name(key));
        }
        text += &text_of(&self.lights, &self.rumble);
        for axis in &self.axes {
            text += &format!("\n[[axis]]\nof = \"{}\"\n", AXIS_NAMES[axis.axis_idx]);
            text += &match axis.from {
                AxisFrom::Place(place) => place.to_text(),
                AxisFrom::Way { full_counts_per_s, .. } => {
                    format!("from = \"{}\"\nfull_counts_per_s = {full_counts_per_s:?}\n", axis.name())
                }
                AxisFrom::Keys { plus, minus, deflection_ratio } => {
                    let [plus, minus] = [plus, minus].map(button_name);
                    format!("plus = \"{plus}\"\nminus = \"{minus}\"\ndeflection = {deflection_ratio:?}\n")
                }
            };
            text += &format!("sign = \"{}\"\n", if axis.is_negated { "-" } else { "+" });
        }
        for button in &self.buttons {
            text += &format!("\n[[button]]\nof = {}\nfrom = \"{}\"\n", button.button, button_name(button.code));
        }
        text
    }
}

impl AxisPlace {
    fn to_text(self) -> String {
        let mut text = format!("from = \"{}\"\n", axis_name(self.code));
        if let Some([low, high]) = self.range {
            text += &format!("range = [{low}, {high}]\n");
        }
        for (key, value) in [("rest", self.rest), ("noise", self.noise)] {
            if let Some(value) = value {
                text += &format!("{key} = {value}\n");
            }
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::LightRole;

    #[test]
    fn every_built_in_profile_is_written_as_it_is_read() {
        for (name, mut profile) in Profile::shipped().expect("good") {
            assert_eq!(Profile::parse(name, &profile.to_text()).expect("readable"), profile, "{name}");
            profile.name = "a \"stick\"\n\\ of mine".to_owned();
            profile.device = ProfileDevice::Path("/dev/input/by-id/my \"own\"".into());
            profile.axes.iter_mut().take(1).for_each(|axis| axis.is_negated = true);
            profile.lights = vec![(LightRole::All, 7), (LightRole::Limit, 1), (LightRole::Compensation, 8)];
            profile.rumble = vec![(LightRole::Fault, 1.0), (LightRole::Load, 0.25)];
            assert_eq!(Profile::parse(name, &profile.to_text()).expect("readable"), profile);
        }
    }

    #[test]
    fn a_device_without_a_profile_has_its_own_six_axes() {
        let profile = Profile::of_input(None, Path::new("/tmp/events"), &[0, 5, 6, 16]);
        let axes: Vec<_> = profile.axes.iter().map(|axis| (axis.axis_idx, axis.name())).collect();
        assert_eq!(axes, [(0, "ABS_X".to_owned()), (5, "ABS_RZ".to_owned())]);
        assert_eq!(profile.device, ProfileDevice::Path("/tmp/events".into()));
    }
}
