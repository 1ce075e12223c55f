//! Access to samples: paths of this computer, and buckets of S3 or a compatible store, by their URL.

use std::path::Path;
use std::sync::Arc;

use datafusion::error::{DataFusionError, Result};
use datafusion::execution::object_store::{DefaultObjectStoreRegistry, ObjectStoreRegistry};
use datafusion::execution::runtime_env::{RuntimeEnv, RuntimeEnvBuilder};
use object_store::ObjectStore;
use object_store::aws::AmazonS3Builder;
use url::Url;

/// The environment of a process: stores by URL, and a folder for data that do not fit into memory (that of the system
/// if not given).
pub(crate) fn runtime_environment(spilled: Option<&Path>) -> Result<Arc<RuntimeEnv>> {
    let runtime = RuntimeEnvBuilder::new().with_object_store_registry(Arc::new(ObjectStores::default()));
    match spilled {
        Some(folder) => runtime.with_temp_file_path(folder).build_arc(),
        None => runtime.build_arc(),
    }
}

/// Registered stores. A bucket of S3 is registered at its first use, with the variables `AWS_ACCESS_KEY_ID`,
/// `AWS_SECRET_ACCESS_KEY`, `AWS_REGION`, `AWS_ENDPOINT`, `AWS_ALLOW_HTTP` etc.
#[derive(Debug, Default)]
struct ObjectStores {
    /// The stores so far.
    known: DefaultObjectStoreRegistry,
}

impl ObjectStoreRegistry for ObjectStores {
    fn register_store(&self, url: &Url, store: Arc<dyn ObjectStore>) -> Option<Arc<dyn ObjectStore>> {
        self.known.register_store(url, store)
    }

    fn deregister_store(&self, url: &Url) -> Result<Arc<dyn ObjectStore>> {
        self.known.deregister_store(url)
    }

    /// The store of a URL; registers a bucket of S3 at its first use.
    fn get_store(&self, url: &Url) -> Result<Arc<dyn ObjectStore>> {
        let known = self.known.get_store(url);
        if known.is_ok() || url.scheme() != "s3" {
            return known;
        }
        let Some(bucket) = url.host_str() else {
            return Err(DataFusionError::Configuration(format!(
                "{url} has no bucket; write it as s3://BUCKET/FOLDER/"
            )));
        };
        let bucket = AmazonS3Builder::from_env().with_bucket_name(bucket);
        let store: Arc<dyn ObjectStore> = Arc::new(bucket.build()?);
        self.known.register_store(url, store.clone());
        Ok(store)
    }
}
