//! The thread of the live view: connects, encodes, sends, and ends in time whatever the viewer does.

use super::super::{Header, Recorder as _, RrdRecorder, recording_id};
use super::queue::{Closing, Queue, is_whole};
use super::{Ended, FLUSH, STARTUP, Viewer};
use prost::Message as _;
use re_protos::log_msg::v1alpha1 as protocol;
use re_protos::log_msg::v1alpha1::log_msg::Msg;
use re_protos::sdk_comms::v1alpha1::WriteMessagesRequest;
use re_protos::sdk_comms::v1alpha1::message_proxy_service_client::MessageProxyServiceClient;
use rerun::external::re_log_encoding::rrd::{Decodable as _, MessageHeader, MessageKind};
use std::cell::RefCell;
use std::io::{self, Write};
use std::pin::pin;
use std::rc::Rc;
use std::time::{Duration, Instant, SystemTime};
use tokio::runtime::Builder;
use tokio::sync::mpsc;
use tokio::time::{sleep, sleep_until};
use tonic::codegen::tokio_stream::wrappers::ReceiverStream;
use tonic::transport::{Channel, Endpoint};

/// How often a viewer that is not there is asked for again.
const RETRY: Duration = Duration::from_millis(200);

/// What is at hand goes to the viewer this often: rarely enough that it comes in few pieces.
const PERIOD: Duration = Duration::from_millis(100);

/// Streams what `queue` gets to `viewer` until the queue is closed; returns how that ended and how many snapshots were
/// sent whole.
pub fn run(queue: &Queue, viewer: &Viewer, header: Header) -> (Ended, u64) {
    let mut sent = 0;
    let runtime = match Builder::new_current_thread().enable_all().build() {
        Ok(runtime) => runtime,
        Err(error) => return (Ended::Lost(error.to_string()), sent),
    };
    let ended = runtime.block_on(show(queue, viewer, header, &mut sent));
    // A name that is still being looked up would hold an orderly end up.
    runtime.shutdown_background();
    (ended, sent)
}

async fn show(queue: &Queue, viewer: &Viewer, header: Header, sent: &mut u64) -> Ended {
    let endpoint = match Endpoint::from_shared(viewer.uri.origin.as_url()) {
        Ok(endpoint) => endpoint,
        Err(error) => return Ended::Lost(error.to_string()),
    };
    let patience = if viewer.started.is_some() {
        STARTUP
    } else {
        FLUSH
    };
    let channel = tokio::select! {
        channel = connect(queue, &endpoint, viewer) => channel,
        () = late(queue, patience) => None,
    };
    let Some(channel) = channel else {
        return Ended::Absent;
    };
    // A viewer that has only just come up gets its time too.
    let connected = Instant::now();
    let late = async {
        let closing = queue.closed().await;
        let since = connected.saturating_duration_since(closing.at);
        late(queue, since + FLUSH).await;
    };
    tokio::select! {
        ended = stream(queue, channel, header, connected, sent) => ended.unwrap_or_else(|e| Ended::Lost(e.to_string())),
        () = late => Ended::Late,
    }
}

/// Returns when the run has been over for `patience`.
async fn late(queue: &Queue, patience: Duration) {
    let closing = queue.closed().await;
    if !closing.abandoned {
        sleep_until((closing.at + patience).into()).await;
    }
}

/// Asks for the viewer until it is there. At the end of the run it is waited for only if it
/// was started for this run.
async fn connect(queue: &Queue, endpoint: &Endpoint, viewer: &Viewer) -> Option<Channel> {
    loop {
        if let Ok(channel) = endpoint.connect().await {
            return Some(channel);
        }
        if viewer.comes_up() {
            sleep(RETRY).await;
        } else {
            tokio::select! {
                () = sleep(RETRY) => {}
                _ = queue.closed() => return None,
            }
        }
    }
}

async fn stream(
    queue: &Queue,
    channel: Channel,
    header: Header,
    connected: Instant,
    sent: &mut u64,
) -> io::Result<Ended> {
    let (sender, requests) = mpsc::channel(1);
    let mut client = MessageProxyServiceClient::new(channel);
    let mut call = pin!(client.write_messages(ReceiverStream::new(requests)));
    let outbox = Outbox::default();
    let mut recorder = RrdRecorder::live(outbox.clone(), header.clone(), &live_id(&header))?;
    let mut batch = 0;
    let mut next_flush = Instant::now();
    let work = async {
        loop {
            let closing = queue.closing();
            if closing.is_some_and(|closing| hurry(&closing, connected)) {
                queue.skip_to_newest();
            }
            let snapshot = queue.take();
            let end = snapshot.is_none().then_some(closing).flatten();
            let now = Instant::now();
            match snapshot {
                Some(snapshot) => {
                    recorder.record(&snapshot)?;
                    batch += u64::from(is_whole(&snapshot));
                    if now >= next_flush {
                        recorder.flush()?;
                        next_flush = now + PERIOD;
                    }
                }
                None if end.is_none() => {
                    tokio::select! {
                        () = queue.arrival() => {}
                        () = sleep_until(next_flush.into()), if !recorder.is_empty() => {
                            recorder.flush()?;
                            next_flush = now + PERIOD;
                        }
                    }
                }
                None => {}
            }
            if let Some(closing) = end {
                recorder.finish(closing.outcome)?;
            }
            // What was recorded waits here or in the recorder; both are empty once it has been flushed.
            for request in outbox.empty() {
                if sender.send(request).await.is_err() {
                    // The call has ended, and says why.
                    return core::future::pending().await;
                }
            }
            if end.is_some() || recorder.is_empty() {
                *sent += core::mem::take(&mut batch);
            }
            if end.is_some() {
                return io::Result::Ok(());
            }
        }
    };
    tokio::select! {
        biased;
        result = &mut call => return Ok(ended(result, false)),
        result = work => result?,
    }
    drop(sender);
    Ok(ended(call.await, true))
}

fn ended<T>(result: Result<T, tonic::Status>, all_sent: bool) -> Ended {
    match result {
        Ok(_) if all_sent => Ended::Complete,
        Ok(_) => Ended::Lost("it ended the stream".to_owned()),
        Err(status) => Ended::Lost(status.message().to_owned()),
    }
}

/// Whether there is only time left for the newest snapshot.
fn hurry(closing: &Closing, connected: Instant) -> bool {
    closing.at.max(connected).elapsed() > FLUSH / 2
}

/// An id of its own, beginning with the one in the file: a viewer that has seen a run of this scene would put this one on
/// top of it.
fn live_id(header: &Header) -> String {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    let now = now.unwrap_or_default().as_micros();
    format!(
        "{}-live-{now:x}-{}",
        recording_id(&header.scene),
        std::process::id()
    )
}

/// Takes the bytes of a recording, which come a message at a time, and turns them into requests to the viewer: what it
/// is sent is what the file would hold.
#[derive(Clone, Default)]
struct Outbox(Rc<RefCell<Vec<WriteMessagesRequest>>>);

impl Outbox {
    fn empty(&self) -> Vec<WriteMessagesRequest> {
        self.0.take()
    }
}

impl Write for Outbox {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let Some((header, payload)) = bytes.split_at_checked(MessageHeader::ENCODED_SIZE_BYTES)
        else {
            // The header of the stream is shorter.
            return Ok(bytes.len());
        };
        let header = MessageHeader::from_rrd_bytes(header).map_err(io::Error::other)?;
        let msg = match header.kind {
            MessageKind::SetStoreInfo => {
                protocol::SetStoreInfo::decode(payload).map(Msg::SetStoreInfo)
            }
            MessageKind::ArrowMsg => protocol::ArrowMsg::decode(payload).map(Msg::ArrowMsg),
            MessageKind::BlueprintActivationCommand => {
                protocol::BlueprintActivationCommand::decode(payload)
                    .map(Msg::BlueprintActivationCommand)
            }
            // The end of a stream is told by ending it.
            MessageKind::End => return Ok(bytes.len()),
        };
        self.0.borrow_mut().push(WriteMessagesRequest {
            log_msg: Some(protocol::LogMsg {
                msg: Some(msg.map_err(io::Error::other)?),
            }),
        });
        Ok(bytes.len())
    }

    /// A message in pieces.
    fn write_vectored(&mut self, pieces: &[io::IoSlice<'_>]) -> io::Result<usize> {
        let pieces: Vec<&[u8]> = pieces.iter().map(|piece| &**piece).collect();
        self.write(&pieces.concat())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
