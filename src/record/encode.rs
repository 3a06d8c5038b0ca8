//! Rerun's stream format, written synchronously and with the same bytes every time.
//!
//! The messages are rerun's own, down to their encoding. What is ours is the order: each message goes to a `Write` in
//! one piece, so that a full disk shows at the message that hit it, and the stores and fields of the footer are sorted,
//! where rerun's own encoder takes them from a hash map.

use rerun::external::re_log_encoding::ToTransport as _;
use rerun::external::re_log_encoding::rrd::{
    Compression, CrateVersion, Encodable as _, EncodingOptions, MessageHeader, MessageKind,
    RRD_FOURCC, RrdFooter, RrdManifestBuilder, Serializer, StreamFooter, StreamHeader,
};
use rerun::external::re_log_types::{
    BlueprintActivationCommand, LogMsg, SetStoreInfo, StoreId, StoreInfo, StoreSource,
};
use rerun::external::re_tuid::Tuid;
use rerun::log::{Chunk, ChunkId, RowId};
use rerun::{AsComponents, TimePoint};
use std::io::{self, Write};

/// An `.rrd` stream in the making.
pub(super) struct Encoder<W> {
    sink: W,
    /// Bytes of the whole messages written so far.
    written: u64,
    buffer: Vec<u8>,
    /// What the footer will list; a stream without one may go on for ever.
    manifests: Option<Vec<(StoreId, RrdManifestBuilder)>>,
    ids: u128,
}

impl<W: Write> Encoder<W> {
    /// Starts a stream that lists its chunks at the end.
    pub fn new(sink: W) -> io::Result<Self> {
        Self::start(sink, Some(Vec::new()))
    }

    /// Starts a stream that is read as it comes, and keeps no list of its chunks.
    pub fn unlisted(sink: W) -> io::Result<Self> {
        Self::start(sink, None)
    }

    fn start(
        mut sink: W,
        manifests: Option<Vec<(StoreId, RrdManifestBuilder)>>,
    ) -> io::Result<Self> {
        let mut buffer = Vec::new();
        StreamHeader {
            fourcc: RRD_FOURCC,
            version: CrateVersion::LOCAL.to_bytes(),
            options: EncodingOptions {
                // LZ4 would gain 3 % on positions and contours.
                compression: Compression::Off,
                serializer: Serializer::Protobuf,
            },
        }
        .to_rrd_bytes(&mut buffer)
        .map_err(io::Error::other)?;
        sink.write_all(&buffer)?;
        Ok(Self {
            sink,
            written: buffer.len() as u64,
            buffer,
            manifests,
            ids: 0,
        })
    }

    /// Bytes of the whole messages written so far: where a file is cut after a failed write.
    pub fn written(&self) -> u64 {
        self.written
    }

    /// The next of a fixed sequence of row ids.
    pub fn row_id(&mut self) -> RowId {
        self.ids += 1;
        RowId::from_u128(self.ids)
    }

    /// The next of a fixed sequence of chunk ids.
    pub fn chunk_id(&mut self) -> ChunkId {
        self.ids += 1;
        ChunkId::from_u128(self.ids)
    }

    /// A chunk of one row, for data that has one value: static, or at one time.
    pub fn single(
        &mut self,
        store: &StoreId,
        entity: &str,
        time: impl Into<TimePoint>,
        data: &dyn AsComponents,
    ) -> io::Result<()> {
        let (chunk, row) = (self.chunk_id(), self.row_id());
        let builder = Chunk::builder_with_id(chunk, entity).with_archetype(row, time, data);
        self.append(store, &builder.build().map_err(io::Error::other)?)
    }

    /// Opens a store. No clock, host or compiler is named in it.
    pub fn open(&mut self, store: &StoreId) -> io::Result<()> {
        self.message(&LogMsg::SetStoreInfo(SetStoreInfo {
            row_id: Tuid::from_u128(0),
            info: StoreInfo::new(
                store.clone(),
                StoreSource::Other(env!("CARGO_PKG_NAME").to_owned()),
            ),
        }))
    }

    /// Writes a chunk into a store.
    pub fn append(&mut self, store: &StoreId, chunk: &Chunk) -> io::Result<()> {
        let arrow = chunk.to_arrow_msg().map_err(io::Error::other)?;
        self.message(&LogMsg::ArrowMsg(store.clone(), arrow))
    }

    /// Makes a blueprint the one that the viewer shows.
    pub fn activate(&mut self, blueprint: &StoreId) -> io::Result<()> {
        self.message(&LogMsg::BlueprintActivationCommand(
            BlueprintActivationCommand {
                blueprint_id: blueprint.clone(),
                make_active: true,
                make_default: true,
            },
        ))
    }

    fn message(&mut self, message: &LogMsg) -> io::Result<()> {
        let transport = message
            .to_transport(Compression::Off)
            .map_err(io::Error::other)?;
        self.buffer.clear();
        transport
            .to_rrd_bytes(&mut self.buffer)
            .map_err(io::Error::other)?;
        self.sink.write_all(&self.buffer)?;
        let header = MessageHeader::ENCODED_SIZE_BYTES as u64;
        let span = re_span::Span {
            start: self.written + header,
            len: self.buffer.len() as u64 - header,
        };
        self.written += self.buffer.len() as u64;
        if let (LogMsg::ArrowMsg(store, arrow), Some(manifests)) = (message, &mut self.manifests) {
            let batch = re_sorbet::ChunkBatch::try_from(&arrow.batch).map_err(io::Error::other)?;
            let known = manifests.iter().position(|(id, _)| id == store);
            let place = known.unwrap_or(manifests.len());
            if known.is_none() {
                let manifest = RrdManifestBuilder::default();
                manifests.push((store.clone(), manifest));
            }
            manifests[place]
                .1
                .append(&batch, span, transport.byte_size_uncompressed())
                .map_err(io::Error::other)?;
        }
        Ok(())
    }

    /// Closes the stream with a footer: which chunk lies where, store by store in the order of their opening.
    pub fn finish(&mut self) -> io::Result<()> {
        let mut footer = RrdFooter::default()
            .to_transport(())
            .map_err(io::Error::other)?;
        for (store, manifest) in self.manifests.take().into_iter().flatten() {
            let mut manifest = manifest.build(store).map_err(io::Error::other)?;
            let mut fields = manifest.sorbet_schema.fields().to_vec();
            fields.sort();
            manifest.sorbet_schema.fields = fields.into();
            footer
                .manifests
                .push(manifest.to_transport(()).map_err(io::Error::other)?);
        }
        // An end message is framed like any other; the stream footer points at its payload.
        self.buffer.clear();
        footer
            .to_rrd_bytes(&mut self.buffer)
            .map_err(io::Error::other)?;
        let mut bytes = Vec::with_capacity(self.buffer.len() + 64);
        MessageHeader {
            kind: MessageKind::End,
            len: self.buffer.len() as u64,
        }
        .to_rrd_bytes(&mut bytes)
        .map_err(io::Error::other)?;
        let start = self.written + bytes.len() as u64;
        bytes.extend_from_slice(&self.buffer);
        StreamFooter::from_rrd_footer_bytes(start, &self.buffer)
            .to_rrd_bytes(&mut bytes)
            .map_err(io::Error::other)?;
        self.sink.write_all(&bytes)?;
        self.sink.flush()?;
        self.written += bytes.len() as u64;
        Ok(())
    }
}
