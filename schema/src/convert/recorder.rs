//! Mirror of the recorder's own counts: one named field per channel, so that a viewer can plot each.

use super::Mirrored;
use crate::channel::Channel;
use crate::proto;
use crate::status::{ChannelCounts, RecorderStatus};
use krait_ipc::Process;

/// Pairs each field with its channel.
macro_rules! fields {
    ($($field:ident: $channel:expr;)*) => {
        impl Mirrored for RecorderStatus {
            type Mirror = proto::RecorderStatus;

            fn mirror(&self) -> proto::RecorderStatus {
                let counts = |channel: Channel| self.of(channel).map(mirror_of);
                let total = self.total();
                proto::RecorderStatus {
                    sequence: self.sequence,
                    sample_ns: self.sample_ns,
                    n_written: total.n_written,
                    n_dropped: total.n_dropped,
                    n_lost: total.n_lost,
                    $($field: counts($channel),)*
                }
            }

            fn restore(mirror: &proto::RecorderStatus) -> Result<Self, String> {
                let mut channels = [ChannelCounts::default(); Channel::N_SHARED];
                // A recording of before a channel was there has no counts of it: none were written.
                $(channels[$channel.index()] = mirror.$field.map_or_else(ChannelCounts::default, counts_of);)*
                Ok(Self { sequence: mirror.sequence, sample_ns: mirror.sample_ns, channels })
            }
        }
    };
}

fields! {
    input: Channel::Input;
    setpoint: Channel::Setpoint;
    command: Channel::Command;
    state: Channel::State;
    state_command: Channel::StateCommand;
    shape: Channel::Shape;
    model_update: Channel::ModelUpdate;
    health_master: Channel::Health(Process::Master);
    health_resolve: Channel::Health(Process::Resolve);
    health_compensate: Channel::Health(Process::Compensate);
    health_estimate: Channel::Health(Process::Estimate);
    health_slave: Channel::Health(Process::Slave);
    health_record: Channel::Health(Process::Record);
    health_shape: Channel::Health(Process::Shape);
    marker: Channel::Marker;
    marker_device: Channel::DeviceMarker;
    drive_cycle: Channel::DriveCycle;
}

fn mirror_of(counts: ChannelCounts) -> proto::ChannelCounts {
    let ChannelCounts { n_written, n_dropped, n_lost, n_out_of_order } = counts;
    proto::ChannelCounts { n_written, n_dropped, n_lost, n_out_of_order }
}

fn counts_of(mirror: proto::ChannelCounts) -> ChannelCounts {
    let proto::ChannelCounts { n_written, n_dropped, n_lost, n_out_of_order } = mirror;
    ChannelCounts { n_written, n_dropped, n_lost, n_out_of_order }
}
