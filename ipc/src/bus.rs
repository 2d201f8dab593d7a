//! Joining an instance, opening its channels with stated sizes, and clearing up after killed processes.

use crate::doorbell::Doorbell;
use crate::membership::Membership;
use crate::memory::{PrivateMemory, look_for_room, take_room};
use crate::message::Message;
use crate::port::Failure;
use crate::{InstanceName, IpcError, ReadOptions, Reader, StopSwitch, Writer};
use core::sync::atomic::AtomicBool;
use iceoryx2::config::Config;
use iceoryx2::node::{NodeState, NodeView};
use iceoryx2::prelude::{
    AttributeVerifier, CallbackProgression, FileName, MessagingPattern, Node, NodeBuilder, NodeName, Path as IoxPath,
    SemanticString, Service as _, ServiceName, SignalHandlingMode,
};
use iceoryx2::service::attribute::{AttributeKey, AttributeValue};
use iceoryx2::service::port_factory::{PortFactory as _, publish_subscribe};
use std::sync::Arc;

pub(crate) type Shm = PrivateMemory;
pub(crate) type DataService<M> = publish_subscribe::PortFactory<Shm, M, ()>;

/// Readers a channel can have at once: the next stage, estimator, recorder, console, lab, and room for a user's own tools.
pub(crate) const MAX_READERS: usize = 24;
/// Samples that a late reader gets from before it joined: the newest one, so that it knows the state at once.
pub(crate) const HISTORY: usize = 1;
/// Samples that a reader may hold at the same time.
pub(crate) const MAX_BORROWED: usize = 2;
/// Processes that may use a channel at once.
const MAX_NODES: usize = 32;
/// Attribute that carries the payload's version.
const VERSION_KEY: &str = "krait.payload.version";

/// A process's membership in an instance.
#[derive(Debug)]
pub struct Bus {
    instance: InstanceName,
    node: Node<Shm>,
    // Dropped last, here and in every port: whoever lets go last clears up.
    membership: Arc<Membership>,
}

impl Bus {
    /// Joins an instance under a process name, and removes what killed processes of that instance left behind.
    ///
    /// # Errors
    /// [`IpcError::InstanceName`] or [`IpcError::Node`].
    pub fn open(instance: &str, process: &str) -> Result<Self, IpcError> {
        Self::open_unless(instance, process, &AtomicBool::new(false))
    }

    /// The same, given up when `stop` is set while another process holds the instance's lock.
    ///
    /// # Errors
    /// As [`Bus::open`].
    pub fn open_unless(instance: &str, process: &str, stop: &AtomicBool) -> Result<Self, IpcError> {
        let instance = InstanceName::new(instance)?;
        let failed = |source_text: String| IpcError::Node {
            instance: instance.as_str().to_owned(),
            process: process.to_owned(),
            source_text,
        };
        let membership = Membership::join(&instance, stop).map_err(|e| failed(e.to_string()))?;
        look_for_room(&instance.folder()).map_err(|e| failed(e.to_string()))?;
        let config = config_for(&instance).map_err(&failed)?;
        let name = NodeName::new(process).map_err(|e| failed(format!("{e:?}")))?;
        let node = NodeBuilder::new()
            .config(&config)
            .name(&name)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<Shm>()
            .map_err(|e| failed(format!("{e:?}")))?;
        Ok(Self { instance, node, membership: Arc::new(membership) })
    }

    /// The instance's name.
    pub fn instance(&self) -> &InstanceName {
        &self.instance
    }

    /// Names and process ids of the living members of the instance, this one included.
    pub fn members(&self) -> Vec<(String, u32)> {
        let mut members = Vec::new();
        let listed = Node::<Shm>::list(self.node.config(), |state| {
            if let NodeState::Alive(view) = state
                && let Some(details) = view.details()
            {
                let pid = u32::try_from(details.process_id().value()).unwrap_or(0);
                members.push((details.name().as_str().to_owned(), pid));
            }
            CallbackProgression::Continue
        });
        if let Err(error) = listed {
            tracing::warn!(?error, "the instance's members could not all be listed");
        }
        members
    }

    /// Becomes the one writer of a message's own channel.
    ///
    /// # Errors
    /// [`IpcError::SecondWriter`], [`IpcError::Version`] or [`IpcError::Channel`].
    pub fn writer<M: Message>(&self) -> Result<Writer<M>, IpcError> {
        self.writer_on(M::CHANNEL)
    }

    /// Becomes the one writer of a named channel.
    ///
    /// # Errors
    /// [`IpcError::SecondWriter`], [`IpcError::Version`] or [`IpcError::Channel`].
    pub fn writer_on<M: Message>(&self, channel: &str) -> Result<Writer<M>, IpcError> {
        self.look_for_room(channel)?;
        let address = self.address(channel);
        let publisher = M::publisher(self, &address)?;
        let writer = Writer::new(address, publisher, self.doorbell(channel)?);
        self.take_room(channel)?;
        Ok(writer)
    }

    /// Becomes a reader of a message's own channel.
    ///
    /// # Errors
    /// [`IpcError::TooManyReaders`], [`IpcError::Version`] or [`IpcError::Channel`].
    pub fn reader<M: Message>(&self, options: ReadOptions) -> Result<Reader<M>, IpcError> {
        self.reader_on(M::CHANNEL, options)
    }

    /// Becomes a reader of a named channel.
    ///
    /// # Errors
    /// [`IpcError::TooManyReaders`], [`IpcError::Version`] or [`IpcError::Channel`].
    pub fn reader_on<M: Message>(&self, channel: &str, options: ReadOptions) -> Result<Reader<M>, IpcError> {
        self.look_for_room(channel)?;
        let doorbell = if options.wakes() { Some(self.doorbell(channel)?) } else { None };
        let address = self.address(channel);
        let subscriber = M::subscriber(self, &address, options.buffer())?;
        let reader = Reader::new(address, subscriber, doorbell, options);
        self.take_room(channel)?;
        Ok(reader)
    }

    fn look_for_room(&self, channel: &str) -> Result<(), IpcError> {
        look_for_room(&self.instance.folder())
            .map_err(|e| self.address(channel).failed("looking for room", e.to_string()))
    }

    fn take_room(&self, channel: &str) -> Result<(), IpcError> {
        take_room(&self.instance.folder()).map_err(|e| self.address(channel).failed("taking room", e.to_string()))
    }

    fn address(&self, channel: &str) -> ChannelAddress {
        ChannelAddress {
            instance: self.instance.as_str().to_owned(),
            channel: channel.to_owned(),
            _membership: Arc::clone(&self.membership),
        }
    }

    /// Opens the channel's data service, or makes it; a version that differs is an error that names both.
    pub(crate) fn data_service<M: Message>(&self, address: &ChannelAddress) -> Result<DataService<M>, IpcError> {
        let name = address.service_name()?;
        let verifier = version_requirement(M::VERSION).map_err(|e| address.failed("describing its payload", e))?;
        let service = self
            .node
            .service_builder(&name)
            .publish_subscribe::<M>()
            .max_publishers(M::MAX_WRITERS)
            .max_subscribers(MAX_READERS)
            .subscriber_max_buffer_size(M::DEPTH)
            .subscriber_max_borrowed_samples(MAX_BORROWED)
            .history_size(HISTORY)
            .enable_safe_overflow(true)
            .max_nodes(MAX_NODES)
            .open_or_create_with_attributes(&verifier)
            .map_err(|error| match self.version_in_use(&name) {
                Some(found) if found != M::VERSION.to_string() => address.version(M::VERSION, found),
                _ => address.failed("opening its data", format!("{error:?}")),
            })?;
        // Whoever comes first decides; a channel that lets in more writers than it should is not krait's.
        match service.static_config().max_publishers() {
            found if found == M::MAX_WRITERS => Ok(service),
            found => Err(IpcError::Writers {
                instance: address.instance.clone(),
                channel: address.channel.clone(),
                expected: M::MAX_WRITERS,
                found,
            }),
        }
    }

    /// Opens the stop of this instance: to ask for one, or, as the slave, to obey.
    ///
    /// # Errors
    /// [`IpcError::Channel`] when shared memory cannot be had.
    pub fn stop_switch(&self) -> Result<StopSwitch, IpcError> {
        StopSwitch::open(&self.instance.bell_path(StopSwitch::CHANNEL))
            .map_err(|e| self.address(StopSwitch::CHANNEL).failed("opening it", e.to_string()))
    }

    fn doorbell(&self, channel: &str) -> Result<Doorbell, IpcError> {
        Doorbell::open(&self.instance.bell_path(channel))
            .map_err(|e| self.address(channel).failed("opening its doorbell", e.to_string()))
    }

    fn version_in_use(&self, name: &ServiceName) -> Option<String> {
        let details = Shm::details(name, self.node.config(), MessagingPattern::PublishSubscribe).ok()??;
        let key = AttributeKey::new(VERSION_KEY.as_bytes()).ok()?;
        details.static_details.attributes().key_value(&key, 0).map(|value| value.to_string())
    }
}

/// Where a channel is, for error sentences; keeps its port's process a member of the instance.
#[derive(Clone, Debug)]
pub struct ChannelAddress {
    pub(crate) instance: String,
    pub(crate) channel: String,
    _membership: Arc<Membership>,
}

impl ChannelAddress {
    pub(crate) fn failed(&self, doing: &'static str, source_text: String) -> IpcError {
        IpcError::Channel { instance: self.instance.clone(), channel: self.channel.clone(), doing, source_text }
    }

    /// What its port failed at.
    #[cold]
    pub(crate) fn at(&self, failure: Failure) -> IpcError {
        self.failed(failure.doing, failure.source_text)
    }

    fn version(&self, expected: u32, found: String) -> IpcError {
        IpcError::Version { instance: self.instance.clone(), channel: self.channel.clone(), expected, found }
    }

    fn service_name(&self) -> Result<ServiceName, IpcError> {
        ServiceName::new(&format!("krait/{}", self.channel))
            .map_err(|e| self.failed("naming its service", format!("{e:?}")))
    }
}

fn version_requirement(version: u32) -> Result<AttributeVerifier, String> {
    let key = AttributeKey::new(VERSION_KEY.as_bytes()).map_err(|e| format!("{e:?}"))?;
    let value = AttributeValue::new(version.to_string().as_bytes()).map_err(|e| format!("{e:?}"))?;
    AttributeVerifier::new().require(&key, &value).map_err(|e| format!("{e:?}"))
}

/// iceoryx2's settings for one instance: a folder of its own, so that instances never see each other, and never a configuration
/// file from the working directory.
fn config_for(instance: &InstanceName) -> Result<Config, String> {
    let mut config = Config::default();
    let root = instance.folder();
    let root = IoxPath::new(root.as_os_str().as_encoded_bytes()).map_err(|e| format!("{e:?}"))?;
    config.global.set_root_path(&root);
    config.global.prefix = FileName::new(b"krait.").map_err(|e| format!("{e:?}"))?;
    Ok(config)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message::Command;

    #[test]
    fn a_channel_that_a_stranger_made_for_two_writers_is_refused_by_name() {
        let bus = Bus::open(&format!("t-stranger-{}", std::process::id()), "test").expect("joined");
        let name = bus.address(Command::CHANNEL).service_name().expect("a name");
        let stranger = bus.node.service_builder(&name).publish_subscribe::<Command>();
        let stranger = stranger.max_publishers(2).max_subscribers(MAX_READERS).max_nodes(MAX_NODES);
        let stranger = stranger.subscriber_max_buffer_size(Command::DEPTH).history_size(HISTORY);
        let stranger = stranger.subscriber_max_borrowed_samples(MAX_BORROWED).enable_safe_overflow(true);
        let version = version_requirement(Command::VERSION).expect("a version");
        let _made_first = stranger.open_or_create_with_attributes(&version).expect("made");
        let slave = bus.reader::<Command>(ReadOptions::waking()).map(|_| ());
        let compensate = bus.writer::<Command>().map(|_| ());
        for refused in [slave, compensate] {
            let sentence = refused.expect_err("two writers").to_string();
            assert!(sentence.contains("\"command\"") && sentence.contains("2 writers, expected 1"), "{sentence}");
        }
    }
}
