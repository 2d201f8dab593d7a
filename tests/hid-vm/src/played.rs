//! A HID device that this process plays: a thread hears what the kernel tells it, and its end is one piece, wanted or not.

use crate::spacemouse::wait_for;
use crate::uhid::{HidBus, HidIdentity, Told, Uhid};
use anyhow::bail;
use krait_master::{InputDevice, list_inputs};
use std::thread::JoinHandle;

/// A device, plugged in until it is dropped or unplugged.
pub struct Played {
    uhid: Uhid,
    listener: Option<JoinHandle<()>>,
}

impl Played {
    /// Makes the device; its node appears a little later. Whatever the kernel tells it is heard in a thread of its own.
    ///
    /// # Errors
    /// The kernel makes no device, or there is no thread.
    pub fn plug(
        identity: HidIdentity,
        descriptor: &[u8],
        mut hear: impl FnMut(Told) + Send + 'static,
    ) -> anyhow::Result<Self> {
        let uhid = Uhid::create(identity, descriptor)?;
        let mut heard = uhid.handle()?;
        let listen = move || {
            while let Ok(told) = heard.next()
                && told != Told::Stop
            {
                hear(told);
            }
        };
        let listener = std::thread::Builder::new().name("uhid".to_owned()).spawn(listen)?;
        Ok(Self { uhid, listener: Some(listener) })
    }

    /// Sends one input report, as [`Uhid::input`].
    ///
    /// # Errors
    /// The device is gone.
    pub fn input(&mut self, report: &[u8]) -> anyhow::Result<()> {
        self.uhid.input(report)
    }

    /// Pulls the plug and waits until the kernel has said that nothing follows; done once, whoever asks.
    ///
    /// # Errors
    /// The kernel does not take it away, or the thread that listens to it died.
    pub fn unplug(&mut self) -> anyhow::Result<()> {
        let Some(listener) = self.listener.take() else { return Ok(()) };
        self.uhid.destroy()?;
        match listener.join() {
            Ok(()) => Ok(()),
            Err(_) => bail!("the thread that listens to the kernel died"),
        }
    }
}

/// A part that ends early leaves no device behind for the next.
impl Drop for Played {
    fn drop(&mut self) {
        let _nobody_asks_any_more = self.unplug();
    }
}

/// Who a device of the kernel's input system says it is.
#[derive(Clone, Copy, Debug)]
pub struct InputIdentity {
    /// Its name, by which its node is found.
    pub name: &'static str,
    /// One word for it.
    pub word: &'static str,
    /// How it is connected.
    pub bus: HidBus,
    /// USB vendor id.
    pub vendor_id: u16,
    /// USB product id.
    pub product_id: u16,
}

/// A device that has a node of the kernel's input system while it is plugged in.
pub struct PlayedInput {
    played: Played,
    identity: InputIdentity,
}

impl PlayedInput {
    /// Plugs it in and waits for its node.
    ///
    /// # Errors
    /// As [`Played::plug`], and there is no node.
    pub fn plug(
        identity: InputIdentity,
        descriptor: &[u8],
        hear: impl FnMut(Told) + Send + 'static,
    ) -> anyhow::Result<Self> {
        let InputIdentity { name, word, bus, vendor_id, product_id } = identity;
        let place = format!("krait-vm/{word}");
        let of_hid = HidIdentity { name, serial: "SN-1", place: &place, bus, vendor_id, product_id };
        let input = Self { played: Played::plug(of_hid, descriptor, hear)?, identity };
        wait_for(&format!("the node of the {word}"), || node_of(name).is_some_and(|input| input.may_open))?;
        Ok(input)
    }

    /// As [`Played::input`].
    ///
    /// # Errors
    /// The device is gone.
    pub fn input(&mut self, report: &[u8]) -> anyhow::Result<()> {
        self.played.input(report)
    }
}

impl Drop for PlayedInput {
    fn drop(&mut self) {
        if self.played.unplug().is_ok() {
            let InputIdentity { name, word, .. } = self.identity;
            let _it_may_stay_a_little = wait_for(&format!("the end of the {word}'s node"), || node_of(name).is_none());
        }
    }
}

/// The node of the device of that name.
pub fn node_of(name: &str) -> Option<InputDevice> {
    list_inputs().into_iter().find(|input| input.name == name)
}
