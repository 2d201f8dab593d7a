//! Plays a script: at every tick it says what the script asks for at that instant.

use crate::source::sleep_until;
use crate::{ReportSource, Script, SourceEvent};

/// Plays a script from an instant on, once or again and again.
#[derive(Debug)]
pub struct ScriptSource {
    script: Script,
    looping: bool,
    start_ns: Option<i64>,
    told_ns: Option<i64>,
    is_end_told: bool,
}

impl ScriptSource {
    /// A player that waits for its start.
    pub fn new(script: Script, looping: bool) -> Self {
        Self { script, looping, start_ns: None, told_ns: None, is_end_told: false }
    }
}

impl ReportSource for ScriptSource {
    fn start(&mut self, now_ns: i64) {
        self.start_ns = Some(now_ns);
    }

    fn wait_until(&mut self, deadline_ns: i64) {
        sleep_until(deadline_ns);
    }

    fn next_event(&mut self, now_ns: i64) -> Option<SourceEvent> {
        let mut start_ns = self.start_ns?;
        if self.told_ns == Some(now_ns) {
            return None;
        }
        self.told_ns = Some(now_ns);
        if self.looping && now_ns - start_ns > self.script.duration_ns() {
            start_ns = now_ns;
            self.start_ns = Some(now_ns);
        }
        match self.script.at(now_ns - start_ns) {
            Some(sample) => Some(SourceEvent::Script(sample)),
            None if self.is_end_told => None,
            None => {
                self.is_end_told = true;
                Some(SourceEvent::Ended)
            }
        }
    }

    fn vid_pid(&self) -> Option<(u16, u16)> {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE: &[u8] = b"time_s,tip_vx_m_per_s,tip_vy_m_per_s,tip_vz_m_per_s\n0,0,0,0\n1,0.01,0,0\n";

    #[test]
    fn a_script_is_asked_once_per_instant_and_ends_once() {
        let mut source = ScriptSource::new(Script::parse("test", TABLE).expect("script"), false);
        assert!(source.next_event(0).is_none(), "not started");
        source.start(1_000);
        let Some(SourceEvent::Script(sample)) = source.next_event(500_001_000) else { panic!("a sample") };
        assert_eq!(sample.tip_vel_in_view_m_per_s[0], 0.005);
        assert!(source.next_event(500_001_000).is_none());
        assert!(matches!(source.next_event(1_000_001_001), Some(SourceEvent::Ended)));
        assert!(source.next_event(1_000_001_002).is_none());
    }

    #[test]
    fn a_looping_script_begins_again() {
        let mut source = ScriptSource::new(Script::parse("test", TABLE).expect("script"), true);
        source.start(0);
        assert!(matches!(source.next_event(1_000_000_001), Some(SourceEvent::Script(_))));
        let Some(SourceEvent::Script(sample)) = source.next_event(1_500_000_001) else { panic!("a sample") };
        assert_eq!(sample.tip_vel_in_view_m_per_s[0], 0.005);
    }
}
