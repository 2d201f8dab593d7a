//! Who sends: the user whose socket a datagram of this machine came from, by the kernel's own table.
//!
//! Problem: on the loopback address every user of the machine can send, and a datagram does not say whose it is.
//!
//! Intuition: the kernel lists every UDP socket with its address and its user (`man 5 proc_pid_net`). The socket that a packet
//! came from is still there, because a hand goes on sending; one that is not is nobody that a snake should follow.

use std::io;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};

/// The kernel's tables.
const TABLES: [&str; 2] = ["/proc/net/udp", "/proc/net/udp6"];
/// Columns of a table, counted from 0: the socket's own address, its user.
const LOCAL: usize = 1;
const USER: usize = 7;
/// Digits of an IPv4 address and of an IPv6 address.
const N_DIGITS_V4: usize = 8;
const N_DIGITS_V6: usize = 32;

/// The user id of the socket with this address; nothing where this machine has none.
///
/// # Errors
/// A table that cannot be read.
pub(crate) fn owner_of(sender: SocketAddr) -> io::Result<Option<u32>> {
    for table in TABLES {
        let text = match std::fs::read_to_string(table) {
            // A kernel without IPv6.
            Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
            read => read?,
        };
        if let Some(user) = owner_in(&text, sender) {
            return Ok(Some(user));
        }
    }
    Ok(None)
}

/// The same, in the text of a table: the socket that is bound to just this address, else the one that takes every address.
fn owner_in(table: &str, sender: SocketAddr) -> Option<u32> {
    let wanted = sender.ip().to_canonical();
    let sockets = || table.lines().filter_map(socket).filter(|(local, _)| local.port() == sender.port());
    let exact = sockets().find(|(local, _)| local.ip() == wanted);
    exact.or_else(|| sockets().find(|(local, _)| local.ip().is_unspecified())).map(|(_, user)| user)
}

/// A line of a table: address and user; nothing for its head.
fn socket(line: &str) -> Option<(SocketAddr, u32)> {
    let mut words = line.split_ascii_whitespace();
    let (address, port) = words.nth(LOCAL)?.split_once(':')?;
    let user = words.nth(USER - LOCAL - 1)?.parse().ok()?;
    Some((SocketAddr::new(ip(address)?, u16::from_str_radix(port, 16).ok()?), user))
}

/// An address as the kernel writes it: words of 32 bits, each with the machine's own order of bytes.
fn ip(digits: &str) -> Option<IpAddr> {
    let word = |k: usize| Some(u32::from_str_radix(digits.get(8 * k..8 * k + 8)?, 16).ok()?.to_ne_bytes());
    match digits.len() {
        N_DIGITS_V4 => Some(Ipv4Addr::from(word(0)?).into()),
        N_DIGITS_V6 => {
            let mut octets = [0; 16];
            for (k, place) in octets.chunks_exact_mut(4).enumerate() {
                place.copy_from_slice(&word(k)?);
            }
            Some(IpAddr::from(Ipv6Addr::from(octets)).to_canonical())
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::process::geteuid;
    use std::net::UdpSocket;

    #[test]
    fn an_own_socket_is_found_with_its_user_and_a_closed_one_is_nobodys() {
        for bound in ["127.0.0.1:0", "0.0.0.0:0", "[::1]:0", "[::]:0"] {
            let Ok(socket) = UdpSocket::bind(bound) else { continue };
            let port = socket.local_addr().expect("bound").port();
            let ip: IpAddr = if bound.contains('[') { Ipv6Addr::LOCALHOST.into() } else { Ipv4Addr::LOCALHOST.into() };
            let sender = SocketAddr::new(ip, port);
            assert_eq!(owner_of(sender).expect("a table"), Some(geteuid().as_raw()), "{bound}");
            drop(socket);
            assert_eq!(owner_of(sender).expect("a table"), None, "{bound}");
        }
    }

    #[cfg(target_endian = "little")]
    #[test]
    fn a_table_tells_the_bound_socket_from_the_one_that_takes_every_address() {
        let head = "   sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode ref pointer drops\n";
        let line = |local: &str, user: u32| {
            format!("  47: {local} 00000000:0000 07 00000000:00000000 00:00000000 00000000 {user} 0 1 2 0 0\n")
        };
        let table =
            head.to_owned() + &line("00000000:1F90", 7) + &line("0100007F:1F90", 1000) + &line("0100007F:1F91", 65534);
        let of = |address: &str| owner_in(&table, address.parse().expect("an address"));
        assert_eq!(
            [of("127.0.0.1:8080"), of("127.0.0.1:8081"), of("10.0.0.1:8080")],
            [Some(1000), Some(65534), Some(7)]
        );
        assert_eq!([of("127.0.0.1:8082"), of("10.0.0.1:8081")], [None, None]);
        assert_eq!(
            owner_in("nonsense\n 1: xyz:00 q\n 2: 01:02 1 2 3 4 5 x", "1.2.3.4:2".parse().expect("an address")),
            None
        );
    }
}
