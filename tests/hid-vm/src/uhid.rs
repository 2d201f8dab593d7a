//! Raw /dev/uhid: a HID device that this process plays, so that the kernel's own HID system stands between it and krait.
//!
//! Events are the packed structs of <linux/uhid.h>, written by hand: the kernel takes a short write as one whole event.

use anyhow::{Context, ensure};
use std::fs::{File, OpenOptions};
use std::io::{Read, Write};

/// Size of `struct uhid_event`; a read never returns less, bytes.
const EVENT_BYTES: usize = 4380;
/// Offset of the report descriptor in a CREATE2 event, bytes.
const DESCRIPTOR_AT: usize = 280;
/// Longest report that this module sends, bytes.
const MAX_REPORT_BYTES: usize = 64;

/// How a device is connected, by the kernel's numbers.
#[derive(Clone, Copy, Debug)]
#[repr(u16)]
pub enum HidBus {
    /// By a cable.
    Usb = 3,
    /// By radio.
    Bluetooth = 5,
}

const DESTROY: u32 = 1;
const STOP: u32 = 3;
const OUTPUT: u32 = 6;
const CREATE2: u32 = 11;
const INPUT2: u32 = 12;

/// Who a device says it is.
#[derive(Clone, Copy, Debug)]
pub struct HidIdentity<'a> {
    /// Product name, under 128 bytes.
    pub name: &'a str,
    /// Serial number, under 64 bytes.
    pub serial: &'a str,
    /// Where it is plugged in, under 64 bytes.
    pub place: &'a str,
    /// How it is connected.
    pub bus: HidBus,
    /// USB vendor id.
    pub vendor_id: u16,
    /// USB product id.
    pub product_id: u16,
}

/// What the kernel tells the device.
#[derive(Debug, PartialEq, Eq)]
pub enum Told {
    /// An output report, id first.
    Output(Vec<u8>),
    /// The device is gone; nothing follows.
    Stop,
    /// Anything else: the device started, was opened or closed.
    Other,
}

/// A device that exists in the kernel until it is destroyed or closed.
#[derive(Debug)]
pub struct Uhid(File);

impl Uhid {
    /// Makes the device. Its node appears a little later.
    ///
    /// # Errors
    /// The kernel has no uhid, or this process may not use it, or the texts or the descriptor are too long.
    pub fn create(identity: HidIdentity, descriptor: &[u8]) -> anyhow::Result<Self> {
        let longest = identity.serial.len().max(identity.place.len());
        ensure!(
            identity.name.len() < 128 && longest < 64 && descriptor.len() <= 4096,
            "a text of a device is too long"
        );
        let mut event = vec![0_u8; DESCRIPTOR_AT + descriptor.len()];
        let mut put = |at: usize, bytes: &[u8]| event[at..at + bytes.len()].copy_from_slice(bytes);
        put(0, &CREATE2.to_le_bytes());
        put(4, identity.name.as_bytes());
        put(132, identity.place.as_bytes());
        put(196, identity.serial.as_bytes());
        put(260, &(descriptor.len() as u16).to_le_bytes());
        put(262, &(identity.bus as u16).to_le_bytes());
        put(264, &u32::from(identity.vendor_id).to_le_bytes());
        put(268, &u32::from(identity.product_id).to_le_bytes());
        put(DESCRIPTOR_AT, descriptor);
        let mut file = OpenOptions::new().read(true).write(true).open("/dev/uhid").context("opening /dev/uhid")?;
        file.write_all(&event).context("creating a uhid device")?;
        Ok(Self(file))
    }

    /// The same device for another thread.
    ///
    /// # Errors
    /// No more file descriptors.
    pub fn handle(&self) -> anyhow::Result<Self> {
        Ok(Self(self.0.try_clone().context("a second handle on /dev/uhid")?))
    }

    /// Sends one input report, id first, at most 64 bytes. The kernel may drop it without saying so.
    ///
    /// # Errors
    /// The device is gone, or the report is too long.
    pub fn input(&mut self, report: &[u8]) -> anyhow::Result<()> {
        ensure!(report.len() <= MAX_REPORT_BYTES, "a report of {} bytes", report.len());
        let mut event = Vec::with_capacity(6 + MAX_REPORT_BYTES);
        event.extend_from_slice(&INPUT2.to_le_bytes());
        event.extend_from_slice(&(report.len() as u16).to_le_bytes());
        event.extend_from_slice(report);
        self.0.write_all(&event).context("sending an input report")
    }

    /// Takes the device away, as pulling its plug does.
    ///
    /// # Errors
    /// It is gone already.
    pub fn destroy(&mut self) -> anyhow::Result<()> {
        self.0.write_all(&DESTROY.to_le_bytes()).context("destroying a uhid device")
    }

    /// Waits for the next word of the kernel.
    ///
    /// # Errors
    /// The device file cannot be read.
    pub fn next(&mut self) -> anyhow::Result<Told> {
        let mut event = vec![0_u8; EVENT_BYTES];
        let n_bytes = self.0.read(&mut event).context("reading /dev/uhid")?;
        ensure!(n_bytes == EVENT_BYTES, "a uhid event of {n_bytes} bytes");
        let kind = u32::from_le_bytes([event[0], event[1], event[2], event[3]]);
        let len = usize::from(u16::from_le_bytes([event[4100], event[4101]]));
        Ok(match kind {
            OUTPUT => Told::Output(event[4..4 + len.min(4096)].to_vec()),
            STOP => Told::Stop,
            _ => Told::Other,
        })
    }
}
