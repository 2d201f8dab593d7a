//! Bare iceoryx2: one publish-subscribe service and one event per hop, and the ways there are to wait for the event.

use super::semaphore_service::SemaphoreService;
use super::{PATIENCE, Place};
use crate::relay::{Inlet, Outlet};
use crate::{BenchError, Kind};
use iceoryx2::config::Config;
use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{
    CallbackProgression, FileDescriptorBased, FileName, Node, NodeBuilder, NodeName, Path as IoxPath, SemanticString,
    ServiceName, SignalHandlingMode, WaitSetBuilder, ipc,
};
use iceoryx2::service::Service;
use iceoryx2::service::port_factory::{event, publish_subscribe};
use krait_ipc::clock::monotonic_ns;
use krait_ipc::{Bell, WaitMode};
use rustix::event::{PollFd, PollFlags, Timespec, epoll, poll};
use std::os::fd::BorrowedFd;
use std::path::Path;

/// How long `iceoryx2-futex-spin` looks before it sleeps, ns: about one hop.
const SPIN_NS: i64 = 50_000;
/// Samples in a subscriber's buffer, as krait's stages have.
const BUFFER: usize = 256;

/// [`PATIENCE`] as the kernel takes it.
const TIMEOUT: Timespec = Timespec { tv_sec: PATIENCE.as_secs().cast_signed(), tv_nsec: 0 };

/// Sleeps until there may be a message; false when the patience is over.
type Wait = Box<dyn FnMut() -> Result<bool, BenchError>>;
/// Tells the next process that there is a message.
type Wake = Box<dyn FnMut() -> Result<(), BenchError>>;

pub(crate) fn inlet(place: &Place, hop: usize) -> Result<Box<dyn Inlet>, BenchError> {
    if place.kind == Kind::Iceoryx2Semaphore {
        return Ok(Box::new(In::<SemaphoreService>::open(place, hop, blocking_wait)?));
    }
    let wait = match (place.plan.wait, place.kind) {
        (WaitMode::Polling, _) => polling,
        (_, Kind::Iceoryx2Blocking) => blocking_wait::<ipc::Service>,
        (_, Kind::Iceoryx2Ppoll) => ppoll,
        (_, Kind::Iceoryx2Epoll) => epolled,
        (_, Kind::Iceoryx2WaitSet) => wait_set,
        (_, Kind::Iceoryx2Futex | Kind::Iceoryx2FutexSpin) => bell,
        _ => timed_wait,
    };
    Ok(Box::new(In::<ipc::Service>::open(place, hop, wait)?))
}

pub(crate) fn outlet(place: &Place, hop: usize) -> Result<Box<dyn Outlet>, BenchError> {
    if place.kind == Kind::Iceoryx2Semaphore {
        return Ok(Box::new(Out::<SemaphoreService>::open(place, hop)?));
    }
    Ok(Box::new(Out::<ipc::Service>::open(place, hop)?))
}

struct In<S: Service> {
    subscriber: Subscriber<S, [u8], ()>,
    wait: Wait,
    spin_ns: i64,
    chain: &'static str,
    _node: Node<S>,
}

struct Out<S: Service> {
    publisher: Publisher<S, [u8], ()>,
    wake: Wake,
    chain: &'static str,
    _node: Node<S>,
}

impl<S: Service> In<S> {
    fn open(
        place: &Place,
        hop: usize,
        wait: impl FnOnce(&Place, usize, event::PortFactory<S>) -> Result<Wait, BenchError>,
    ) -> Result<Self, BenchError> {
        let chain = place.kind.name();
        let (node, data, event) = open::<S>(place, hop)?;
        let subscriber = data
            .subscriber_builder()
            .buffer_size(BUFFER)
            .create()
            .map_err(BenchError::transport(chain, "subscribing"))?;
        let spins = place.kind == Kind::Iceoryx2FutexSpin || place.plan.wait == WaitMode::Polling;
        let spin_ns = if spins { SPIN_NS } else { 0 };
        Ok(Self { subscriber, wait: wait(place, hop, event)?, spin_ns, chain, _node: node })
    }

    fn take(&self, message: &mut [u8]) -> Result<bool, BenchError> {
        let sample = self.subscriber.receive().map_err(BenchError::transport(self.chain, "receiving"))?;
        Ok(sample.map(|sample| message.copy_from_slice(sample.payload())).is_some())
    }

    /// Looks for a bounded time.
    fn spin(&self, message: &mut [u8]) -> Result<bool, BenchError> {
        let until_ns = monotonic_ns() + self.spin_ns;
        while monotonic_ns() < until_ns {
            if self.take(message)? {
                return Ok(true);
            }
            core::hint::spin_loop();
        }
        Ok(false)
    }
}

impl<S: Service> Inlet for In<S> {
    fn receive(&mut self, message: &mut [u8]) -> Result<bool, BenchError> {
        let give_up_ns = monotonic_ns() + PATIENCE.as_nanos() as i64;
        while !self.take(message)? {
            if self.spin_ns > 0 && self.spin(message)? {
                return Ok(true);
            }
            if !(self.wait)()? && monotonic_ns() > give_up_ns {
                return Ok(false);
            }
        }
        Ok(true)
    }
}

impl<S: Service + 'static> Out<S> {
    fn open(place: &Place, hop: usize) -> Result<Self, BenchError> {
        let chain = place.kind.name();
        let (node, data, event) = open::<S>(place, hop)?;
        let publisher = data
            .publisher_builder()
            .initial_max_slice_len(place.plan.payload_bytes)
            .create()
            .map_err(BenchError::transport(chain, "publishing"))?;
        let wake: Wake = match (place.plan.wait, place.kind) {
            (WaitMode::Polling, _) => Box::new(|| Ok(())),
            (_, Kind::Iceoryx2Futex | Kind::Iceoryx2FutexSpin) => {
                let bell = open_bell(place, hop)?;
                Box::new(move || bell.ring().map_err(BenchError::transport(chain, "ringing")))
            }
            _ => {
                let notifier: Notifier<S> =
                    event.notifier_builder().create().map_err(BenchError::transport(chain, "becoming notifier"))?;
                Box::new(move || notifier.notify().map(drop).map_err(BenchError::transport(chain, "notifying")))
            }
        };
        Ok(Self { publisher, wake, chain, _node: node })
    }
}

impl<S: Service> Outlet for Out<S> {
    fn send(&mut self, message: &[u8]) -> Result<(), BenchError> {
        let sample = self
            .publisher
            .loan_slice_uninit(message.len())
            .map_err(BenchError::transport(self.chain, "borrowing shared memory"))?;
        sample.write_from_slice(message).send().map_err(BenchError::transport(self.chain, "publishing"))?;
        (self.wake)()
    }
}

type Opened<S> = (Node<S>, publish_subscribe::PortFactory<S, [u8], ()>, event::PortFactory<S>);

fn open<S: Service>(place: &Place, hop: usize) -> Result<Opened<S>, BenchError> {
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
        .create::<S>()
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

fn open_bell(place: &Place, hop: usize) -> Result<Bell, BenchError> {
    let path = Path::new("/dev/shm").join(format!("{}{hop}.bell", place.prefix));
    Bell::open(&path).map_err(BenchError::file("mapped", &path))
}

fn listener<S: Service>(place: &Place, event: &event::PortFactory<S>) -> Result<Listener<S>, BenchError> {
    event.listener_builder().create().map_err(BenchError::transport(place.kind.name(), "listening"))
}

fn timed_wait(place: &Place, _hop: usize, event: event::PortFactory<ipc::Service>) -> Result<Wait, BenchError> {
    let (listener, chain) = (listener(place, &event)?, place.kind.name());
    Ok(Box::new(move || {
        let mut woken = false;
        listener.timed_wait(|_| woken = true, PATIENCE).map_err(BenchError::transport(chain, "waiting"))?;
        Ok(woken)
    }))
}

fn blocking_wait<S: Service>(place: &Place, _hop: usize, event: event::PortFactory<S>) -> Result<Wait, BenchError>
where
    Listener<S>: 'static,
{
    let (listener, chain) = (listener(place, &event)?, place.kind.name());
    Ok(Box::new(move || {
        listener.blocking_wait(|_| {}).map_err(BenchError::transport(chain, "waiting"))?;
        Ok(true)
    }))
}

fn ppoll(place: &Place, _hop: usize, event: event::PortFactory<ipc::Service>) -> Result<Wait, BenchError> {
    let (listener, chain) = (listener(place, &event)?, place.kind.name());
    Ok(Box::new(move || {
        #[allow(unsafe_code)]
        // SAFETY: the listener owns the descriptor and lives as long as this closure.
        let fd = unsafe { BorrowedFd::borrow_raw(listener.file_descriptor().native_handle()) };
        let n_ready = poll(&mut [PollFd::from_borrowed_fd(fd, PollFlags::IN)], Some(&TIMEOUT))
            .map_err(BenchError::transport(chain, "polling"))?;
        if n_ready > 0 {
            listener.try_wait(|_| {}).map_err(BenchError::transport(chain, "draining"))?;
        }
        Ok(n_ready > 0)
    }))
}

fn epolled(place: &Place, _hop: usize, event: event::PortFactory<ipc::Service>) -> Result<Wait, BenchError> {
    let (listener, chain) = (listener(place, &event)?, place.kind.name());
    let interest =
        epoll::create(epoll::CreateFlags::CLOEXEC).map_err(BenchError::transport(chain, "making an epoll"))?;
    #[allow(unsafe_code)]
    // SAFETY: the listener owns the descriptor and moves into the closure, which outlives every use of it.
    let fd = unsafe { BorrowedFd::borrow_raw(listener.file_descriptor().native_handle()) };
    epoll::add(&interest, fd, epoll::EventData::new_u64(0), epoll::EventFlags::IN)
        .map_err(BenchError::transport(chain, "watching its event"))?;
    let none = epoll::Event { flags: epoll::EventFlags::empty(), data: epoll::EventData::new_u64(0) };
    Ok(Box::new(move || {
        let mut ready = [none];
        let n_ready =
            epoll::wait(&interest, &mut ready, Some(&TIMEOUT)).map_err(BenchError::transport(chain, "waiting"))?;
        if n_ready > 0 {
            listener.try_wait(|_| {}).map_err(BenchError::transport(chain, "draining"))?;
        }
        Ok(n_ready > 0)
    }))
}

fn wait_set(place: &Place, _hop: usize, event: event::PortFactory<ipc::Service>) -> Result<Wait, BenchError> {
    let chain = place.kind.name();
    // Both live as long as the process: an attachment borrows them.
    let listener: &'static Listener<ipc::Service> = Box::leak(Box::new(listener(place, &event)?));
    let waits = WaitSetBuilder::new().signal_handling_mode(SignalHandlingMode::Disabled);
    let waits = waits.create::<ipc::Service>().map_err(BenchError::transport(chain, "making a wait set"))?;
    let waits: &'static _ = Box::leak(Box::new(waits));
    let guard =
        waits.attach_deadline(listener, PATIENCE).map_err(BenchError::transport(chain, "attaching its event"))?;
    Ok(Box::new(move || {
        let mut woken = false;
        let on_event = |id: iceoryx2::waitset::WaitSetAttachmentId<ipc::Service>| {
            woken = id.has_event_from(&guard);
            CallbackProgression::Stop
        };
        waits.wait_and_process_once(on_event).map_err(BenchError::transport(chain, "waiting"))?;
        listener.try_wait(|_| {}).map_err(BenchError::transport(chain, "draining"))?;
        Ok(woken)
    }))
}

/// The count of rings is taken after the last look, so the first sleep may be cut short by a ring that was heard before.
fn bell(place: &Place, hop: usize, _event: event::PortFactory<ipc::Service>) -> Result<Wait, BenchError> {
    let (bell, chain) = (open_bell(place, hop)?, place.kind.name());
    let mut heard = 0;
    Ok(Box::new(move || {
        let rung = bell.sleep(heard, PATIENCE).map_err(BenchError::transport(chain, "sleeping"))?;
        heard = bell.rings();
        Ok(rung)
    }))
}

fn polling(_place: &Place, _hop: usize, _event: event::PortFactory<ipc::Service>) -> Result<Wait, BenchError> {
    Ok(Box::new(|| Ok(false)))
}
