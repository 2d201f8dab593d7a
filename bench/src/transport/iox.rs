//! Bare iceoryx2 as it comes: one publish-subscribe service and one event per hop, and `timed_wait` on the event.

use super::{PATIENCE, Place};
use crate::BenchError;
use crate::relay::{Inlet, Outlet};
use iceoryx2::config::Config;
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{
    FileName, Node, NodeBuilder, NodeName, Path as IoxPath, SemanticString, ServiceName, SignalHandlingMode, ipc,
};
use iceoryx2::service::port_factory::{event, publish_subscribe};
use krait_ipc::WaitMode;
use krait_ipc::clock::monotonic_ns;

/// Samples in a subscriber's buffer, as krait's stages have.
const BUFFER: usize = 256;

type Shm = ipc::Service;

/// The way in; it sleeps on the event, or looks again and again where the plan says so.
pub(crate) struct In {
    subscriber: Subscriber<Shm, [u8], ()>,
    listener: Option<Listener<Shm>>,
    chain: &'static str,
    _node: Node<Shm>,
}

/// The way out; nobody is notified where the reader does not sleep.
pub(crate) struct Out {
    publisher: Publisher<Shm, [u8], ()>,
    notifier: Option<Notifier<Shm>>,
    chain: &'static str,
    _node: Node<Shm>,
}

impl In {
    pub(crate) fn open(place: &Place, hop: usize) -> Result<Self, BenchError> {
        let chain = place.kind.name();
        let (node, data, event) = open(place, hop)?;
        let subscriber = data
            .subscriber_builder()
            .buffer_size(BUFFER)
            .create()
            .map_err(BenchError::transport(chain, "subscribing"))?;
        let listen = || event.listener_builder().create().map_err(BenchError::transport(chain, "listening"));
        let listener = (place.plan.wait != WaitMode::Polling).then(listen).transpose()?;
        Ok(Self { subscriber, listener, chain, _node: node })
    }

    fn take(&self, message: &mut [u8]) -> Result<bool, BenchError> {
        let sample = self.subscriber.receive().map_err(BenchError::transport(self.chain, "receiving"))?;
        Ok(sample.map(|sample| message.copy_from_slice(sample.payload())).is_some())
    }
}

impl Inlet for In {
    fn receive(&mut self, message: &mut [u8]) -> Result<bool, BenchError> {
        let give_up_ns = monotonic_ns() + PATIENCE.as_nanos() as i64;
        while !self.take(message)? {
            let mut is_woken = false;
            match &self.listener {
                Some(listener) => {
                    let waited = listener.timed_wait(|_| is_woken = true, PATIENCE);
                    waited.map(drop).map_err(BenchError::transport(self.chain, "waiting"))?;
                }
                None => core::hint::spin_loop(),
            }
            if !is_woken && monotonic_ns() > give_up_ns {
                return Ok(false);
            }
        }
        Ok(true)
    }
}

impl Out {
    pub(crate) fn open(place: &Place, hop: usize) -> Result<Self, BenchError> {
        let chain = place.kind.name();
        let (node, data, event) = open(place, hop)?;
        let publisher = data
            .publisher_builder()
            .initial_max_slice_len(place.plan.payload_bytes)
            .create()
            .map_err(BenchError::transport(chain, "publishing"))?;
        let notify = || event.notifier_builder().create().map_err(BenchError::transport(chain, "becoming notifier"));
        let notifier = (place.plan.wait != WaitMode::Polling).then(notify).transpose()?;
        Ok(Self { publisher, notifier, chain, _node: node })
    }
}

impl Outlet for Out {
    fn send(&mut self, message: &[u8]) -> Result<(), BenchError> {
        let sample = self
            .publisher
            .loan_slice_uninit(message.len())
            .map_err(BenchError::transport(self.chain, "borrowing shared memory"))?;
        sample.write_from_slice(message).send().map_err(BenchError::transport(self.chain, "publishing"))?;
        if let Some(notifier) = &self.notifier {
            notifier.notify().map(drop).map_err(BenchError::transport(self.chain, "notifying"))?;
        }
        Ok(())
    }
}

type Opened = (Node<Shm>, publish_subscribe::PortFactory<Shm, [u8], ()>, event::PortFactory<Shm>);

fn open(place: &Place, hop: usize) -> Result<Opened, BenchError> {
    let chain = place.kind.name();
    let failed = |doing| move |what: String| BenchError::Transport { chain, doing, what };
    let mut config = Config::default();
    let root = place.folder.join("iceoryx2");
    let root =
        IoxPath::new(root.as_os_str().as_encoded_bytes()).map_err(|e| failed("naming its folder")(format!("{e:?}")))?;
    config.global.set_root_path(&root);
    config.global.prefix =
        FileName::new(place.prefix.as_bytes()).map_err(|e| failed("naming its files")(format!("{e:?}")))?;
    let name = |text: &str| ServiceName::new(text).map_err(|e| failed("naming its service")(format!("{e:?}")));
    let node = NodeBuilder::new()
        .config(&config)
        .name(&NodeName::new("relay").map_err(|e| failed("naming its node")(format!("{e:?}")))?)
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create::<Shm>()
        .map_err(|e| failed("making its node")(format!("{e:?}")))?;
    let data = node
        .service_builder(&name(&format!("hop-{hop}"))?)
        .publish_subscribe::<[u8]>()
        .subscriber_max_buffer_size(BUFFER)
        .open_or_create()
        .map_err(|e| failed("opening its data")(format!("{e:?}")))?;
    let event = node
        .service_builder(&name(&format!("hop-{hop}"))?)
        .event()
        .open_or_create()
        .map_err(|e| failed("opening its event")(format!("{e:?}")))?;
    Ok((node, data, event))
}
