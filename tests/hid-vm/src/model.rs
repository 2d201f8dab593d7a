//! What the virtual devices say they are: ids, names and HID report descriptors.

/// Id of the report that a hand controller declares and krait does not know.
pub const VENDOR_REPORT_ID: u8 = 0x42;
/// The serial number of every virtual device.
pub const SERIAL: &str = "KRAIT-VM-1";
/// USB vendor id of every virtual device: 3Dconnexion.
pub const VENDOR_ID: u16 = 0x256f;

/// A device, or one of the nodes of a device with several.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Model {
    /// SpaceMouse Compact; its reports are split, as those of the shipped recording are. The SpaceNavigator's own 046d:c626
    /// would be claimed by hid-logitech on a full kernel, which refuses a uhid device.
    Compact,
    /// A Compact whose descriptor gives the translation report only one axis. The kernel may drop what is shorter than
    /// declared, so that of such a device more gets through.
    ShortCompact,
    /// A Compact whose axes tell where the cap is, as the kernel makes those of a SpaceNavigator: it tells each only when it changes.
    AbsoluteCompact,
    /// A node of the Universal Receiver on which a hand controller may speak, both halves in one report.
    ReceiverHand,
    /// A node of the Universal Receiver on which a mouse may speak.
    ReceiverMouse,
}

impl Model {
    /// USB product id.
    pub fn product_id(self) -> u16 {
        match self {
            Self::Compact | Self::ShortCompact | Self::AbsoluteCompact => 0xc635,
            Self::ReceiverHand | Self::ReceiverMouse => 0xc652,
        }
    }

    /// Product name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Compact | Self::ShortCompact | Self::AbsoluteCompact => "SpaceMouse Compact",
            Self::ReceiverHand | Self::ReceiverMouse => "3Dconnexion Universal Receiver",
        }
    }

    /// Whether both halves of the axes come in one report.
    pub fn is_combined(self) -> bool {
        self == Self::ReceiverHand
    }

    /// The HID report descriptor.
    pub fn descriptor(self) -> Vec<u8> {
        match self {
            Self::Compact => hand([axes(1, 0x30, 3), axes(2, 0x33, 3)].concat()),
            Self::AbsoluteCompact => {
                let absolute = |axes: Vec<u8>| {
                    let [kept @ .., _relative, end] = &axes[..] else { return axes };
                    [kept, &[0x02, *end]].concat()
                };
                hand([absolute(axes(1, 0x30, 3)), absolute(axes(2, 0x33, 3))].concat())
            }
            Self::ShortCompact => hand([axes(1, 0x30, 1), axes(2, 0x33, 3)].concat()),
            Self::ReceiverHand => hand(axes(1, 0x30, 6)),
            Self::ReceiverMouse => {
                let application = [0x05, 0x01, 0x09, 0x02, 0xa1, 0x01, 0x09, 0x01];
                [&application[..], &axes(1, 0x30, 3), &[0xc0]].concat()
            }
        }
    }
}

/// A multi-axis controller: its axes, 3 sixteen buttons, 4 the light, and a report of the vendor's own.
fn hand(axes: Vec<u8>) -> Vec<u8> {
    const BUTTONS: [u8; 25] = [
        0xa1, 0x02, 0x85, 0x03, 0x05, 0x09, 0x19, 0x01, 0x29, 0x10, 0x15, 0x00, 0x25, 0x01, 0x35, 0x00, 0x45,
        0x01, //
        0x75, 0x01, 0x95, 0x10, 0x81, 0x02, 0xc0,
    ];
    const LIGHT: [u8; 23] = [
        0xa1, 0x02, 0x85, 0x04, 0x05, 0x08, 0x09, 0x4b, 0x15, 0x00, 0x25, 0x01, 0x95, 0x01, 0x75, 0x01, 0x91,
        0x02, //
        0x95, 0x07, 0x91, 0x03, 0xc0,
    ];
    const VENDOR: [u8; 23] = [
        0x06,
        0x00,
        0xff,
        0x09,
        0x01,
        0xa1,
        0x01,
        0x15,
        0x00,
        0x26,
        0xff,
        0x00,
        0x75,
        0x08, //
        0x85,
        VENDOR_REPORT_ID,
        0x09,
        0x20,
        0x95,
        0x07,
        0x81,
        0x02,
        0xc0,
    ];
    let application = [0x05, 0x01, 0x09, 0x08, 0xa1, 0x01];
    [&application[..], &axes, &BUTTONS, &LIGHT, &[0xc0], &VENDOR].concat()
}

/// One report of axes with 16 bits each, -350..=350.
fn axes(id: u8, first_usage: u8, n_axes: u8) -> Vec<u8> {
    const LOGICAL_350_PHYSICAL_1400: [u8; 12] =
        [0x16, 0xa2, 0xfe, 0x26, 0x5e, 0x01, 0x36, 0x88, 0xfa, 0x46, 0x78, 0x05];
    let mut bytes = vec![0xa1, 0x00, 0x85, id];
    bytes.extend_from_slice(&LOGICAL_350_PHYSICAL_1400);
    bytes.extend((0..n_axes).flat_map(|k| [0x09, first_usage + k]));
    bytes.extend_from_slice(&[0x75, 0x10, 0x95, n_axes, 0x81, 0x06, 0xc0]);
    bytes
}
