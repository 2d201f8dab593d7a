//! Mirror of the recorder's own counts: one named field per channel, so that a viewer can plot each.

use super::Mirrored;
use crate::channel::Channel;
use crate::proto;
use crate::status::{ChannelCounts, RecorderStatus};
use krait_ipc::Process;

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
            input: counts(Channel::Input),
            setpoint: counts(Channel::Setpoint),
            command: counts(Channel::Command),
            state: counts(Channel::State),
            state_command: counts(Channel::StateCommand),
            shape: counts(Channel::Shape),
            model_update: counts(Channel::ModelUpdate),
            health_master: counts(Channel::Health(Process::Master)),
            health_resolve: counts(Channel::Health(Process::Resolve)),
            health_compensate: counts(Channel::Health(Process::Compensate)),
            health_estimate: counts(Channel::Health(Process::Estimate)),
            health_slave: counts(Channel::Health(Process::Slave)),
            health_record: counts(Channel::Health(Process::Record)),
            marker: counts(Channel::Marker),
            marker_device: counts(Channel::DeviceMarker),
        }
    }

    fn restore(mirror: &proto::RecorderStatus) -> Result<Self, String> {
        let channels = [
            mirror.input,
            mirror.setpoint,
            mirror.command,
            mirror.state,
            mirror.state_command,
            mirror.shape,
            mirror.model_update,
            mirror.health_master,
            mirror.health_resolve,
            mirror.health_compensate,
            mirror.health_estimate,
            mirror.health_slave,
            mirror.health_record,
            mirror.marker,
            mirror.marker_device,
        ];
        let channels = channels.map(|counts| counts_of(counts.unwrap_or_default()));
        Ok(Self { sequence: mirror.sequence, sample_ns: mirror.sample_ns, channels })
    }
}

fn mirror_of(counts: ChannelCounts) -> proto::ChannelCounts {
    let ChannelCounts { n_written, n_dropped, n_lost, n_out_of_order } = counts;
    proto::ChannelCounts { n_written, n_dropped, n_lost, n_out_of_order }
}

fn counts_of(mirror: proto::ChannelCounts) -> ChannelCounts {
    let proto::ChannelCounts { n_written, n_dropped, n_lost, n_out_of_order } = mirror;
    ChannelCounts { n_written, n_dropped, n_lost, n_out_of_order }
}
