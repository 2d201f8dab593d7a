//! Where the stop is served: on a thread of its own, which waits for no file and no other page, and on both addresses of `localhost`.
//!
//! Problem: a browser takes `localhost` for 127.0.0.1 or for ::1. If another program had the second, it would be shown as the stop.
//! Intuition: both are taken, with one port, or neither. Only a machine without version 6 has one.

use crate::server::until;
use crate::{ConsoleError, accept};
use axum::Router;
use core::net::{IpAddr, Ipv4Addr, Ipv6Addr};
use std::io::ErrorKind;
use std::net::TcpListener;
use std::sync::atomic::AtomicBool;

/// Ports that are tried where any will do.
const MOST_TRIES: usize = 32;

/// Both sockets of the stop.
#[derive(Debug)]
pub struct StopDoor {
    fourth: TcpListener,
    /// None on a machine without version 6.
    sixth: Option<TcpListener>,
}

impl StopDoor {
    /// Takes a port on both addresses; 0: any that is free on both.
    ///
    /// # Errors
    /// [`ConsoleError::Listen`] where one of them is another program's.
    pub fn open(port: u16) -> Result<Self, ConsoleError> {
        let mut opened = Self::open_once(port);
        for _ in 1..MOST_TRIES {
            match opened {
                // Free on the one address, and another program's on the other.
                Err(ConsoleError::Listen { .. }) if port == 0 => opened = Self::open_once(port),
                other => return other,
            }
        }
        opened
    }

    fn open_once(port: u16) -> Result<Self, ConsoleError> {
        let bind = |address: IpAddr, port| {
            let bound = TcpListener::bind((address, port)).and_then(|own| own.set_nonblocking(true).map(|()| own));
            bound.map_err(|source| (source.kind(), ConsoleError::Listen { address, port, source }))
        };
        let fourth = bind(Ipv4Addr::LOCALHOST.into(), port).map_err(|(_, error)| error)?;
        let own_port = fourth.local_addr().map_err(ConsoleError::Start)?.port();
        let sixth = match bind(Ipv6Addr::LOCALHOST.into(), own_port) {
            Ok(sixth) => Some(sixth),
            Err((ErrorKind::AddrInUse | ErrorKind::PermissionDenied, error)) => return Err(error),
            Err((_, error)) => {
                tracing::debug!(%error, "the stop has one address only");
                None
            }
        };
        Ok(Self { fourth, sixth })
    }

    /// The port of both.
    ///
    /// # Errors
    /// [`ConsoleError::Start`]: what the kernel says.
    pub fn port(&self) -> Result<u16, ConsoleError> {
        self.fourth.local_addr().map(|address| address.port()).map_err(ConsoleError::Start)
    }

    /// Serves until told to stop.
    ///
    /// # Errors
    /// [`ConsoleError::Start`]: what the kernel says.
    pub fn serve(self, routes: Router, stop: &AtomicBool) -> Result<(), ConsoleError> {
        let runtime =
            tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(ConsoleError::Start)?;
        runtime.block_on(async {
            let serve = async |listener: TcpListener| -> Result<(), ConsoleError> {
                let listener = tokio::net::TcpListener::from_std(listener).map_err(ConsoleError::Start)?;
                accept::serve(listener, routes.clone()).await;
                Ok(())
            };
            let sixth = async {
                match self.sixth {
                    Some(listener) => serve(listener).await,
                    None => core::future::pending().await,
                }
            };
            tokio::select! {
                ended = serve(self.fourth) => ended,
                ended = sixth => ended,
                () = until(stop) => Ok(()),
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn where_another_program_has_one_of_the_addresses_the_port_is_refused_or_another_is_taken() {
        let Ok(stranger) = TcpListener::bind((Ipv6Addr::LOCALHOST, 0)) else {
            println!("SKIPPED ALOUD: this machine has no ::1");
            return;
        };
        let port = stranger.local_addr().expect("an address").port();
        let told = StopDoor::open(port).expect_err("it is taken").to_string();
        assert!(told.contains(&format!("[::1]:{port}")) && told.contains("--stop-port"), "{told}");
        let door = StopDoor::open(0).expect("another port");
        assert_ne!(door.port().expect("a port"), port);
        assert!(door.sixth.is_some());
    }
}
