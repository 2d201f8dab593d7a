//! Accepts connections on one socket: so many at once, and none may take its time over what it asks for. Each request carries the
//! allowance of its connection.

use crate::allowance::SharedAllowance;
use axum::Router;
use core::time::Duration;
use hyper::Request;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::{Service, service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use rustix::net::sockopt::set_socket_send_buffer_size;
use std::sync::Arc;
use tokio::net::TcpListener;
use tokio::sync::Semaphore;

/// Connections at once; a browser opens six for a page besides its live one.
const MOST_CONNECTIONS: usize = 256;
/// What may wait in the kernel for whoever reads slowly, bytes (the kernel takes twice as much, with its own book-keeping): less than a
/// second of a page's pictures. By itself it would keep some twenty seconds of them before the server noticed.
const MOST_WAITING_BYTES: usize = 64 * 1024;
/// Whoever has not said what it wants by then is hung up on.
const HEADER_PATIENCE: Duration = Duration::from_secs(5);

/// Serves forever.
pub async fn serve(listener: TcpListener, router: Router) {
    let room = Arc::new(Semaphore::new(MOST_CONNECTIONS));
    loop {
        let stream = match listener.accept().await {
            Ok((stream, _)) => stream,
            Err(error) => {
                // Out of file descriptors, or a connection that was gone at once: neither ends the console.
                tracing::warn!(%error, "a connection could not be accepted");
                tokio::time::sleep(Duration::from_millis(50)).await;
                continue;
            }
        };
        let Ok(place) = Arc::clone(&room).try_acquire_owned() else {
            tracing::warn!("a connection was refused because {MOST_CONNECTIONS} are open");
            continue;
        };
        if let Err(error) = stream.set_nodelay(true) {
            tracing::debug!(%error, "a connection's small messages may wait for each other");
        }
        if let Err(error) = set_socket_send_buffer_size(&stream, MOST_WAITING_BYTES) {
            tracing::debug!(%error, "more than wanted may wait for a slow reader");
        }
        let (routes, allowance) = (TowerToHyperService::new(router.clone()), SharedAllowance::of_connection());
        let service = service_fn(move |mut request: Request<Incoming>| {
            request.extensions_mut().insert(allowance.clone());
            routes.call(request)
        });
        tokio::spawn(async move {
            let served = http1::Builder::new()
                .timer(TokioTimer::new())
                .header_read_timeout(HEADER_PATIENCE)
                .max_buf_size(16 * 1024)
                .serve_connection(TokioIo::new(stream), service)
                .with_upgrades()
                .await;
            if let Err(error) = served {
                tracing::debug!(%error, "a connection ended");
            }
            drop(place);
        });
    }
}
