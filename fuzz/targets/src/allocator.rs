//! The allocator of the system, which also counts: bytes in use, their maximum, and the sum of all requests.
//!
//! Requests count at their stated size, whether or not the memory is touched, so that a reader that trusts a stated size
//! is detected on machines that give memory only when it is used.
#![allow(
    unsafe_code,
    reason = "the interface of allocators is unsafe; every call is passed on unchanged"
)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// The allocator of the system with counters.
struct CountingAllocator;

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// Bytes in use.
static IN_USE: AtomicUsize = AtomicUsize::new(0);
/// The largest value of `IN_USE` since the last reset.
static PEAK: AtomicUsize = AtomicUsize::new(0);
/// The sum of all requests, in bytes.
static REQUESTED: AtomicUsize = AtomicUsize::new(0);

/// Counts a request.
fn count_request(size: usize) {
    let now = IN_USE.fetch_add(size, Relaxed).saturating_add(size);
    PEAK.fetch_max(now, Relaxed);
    REQUESTED.fetch_add(size, Relaxed);
}

// SAFETY: all methods are those of the system's allocator with the same arguments.
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count_request(layout.size());
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count_request(layout.size());
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, memory: *mut u8, layout: Layout) {
        IN_USE.fetch_sub(layout.size(), Relaxed);
        // SAFETY: the caller's promise is passed on.
        unsafe { System.dealloc(memory, layout) }
    }

    unsafe fn realloc(&self, memory: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count_request(size);
        IN_USE.fetch_sub(layout.size(), Relaxed);
        // SAFETY: the caller's promise is passed on.
        unsafe { System.realloc(memory, layout, size) }
    }
}

/// Memory in use at a moment.
pub(crate) struct MemoryMark {
    in_use: usize,
    requested: usize,
}

/// Memory that was requested since a mark, in bytes.
pub(crate) struct MemoryUse {
    /// The largest sum in use at one time.
    pub(crate) peak: usize,
    /// The sum of all requests.
    pub(crate) requested: usize,
}

impl MemoryMark {
    /// Marks this moment, and starts a new maximum.
    pub(crate) fn set() -> Self {
        let in_use = IN_USE.load(Relaxed);
        PEAK.store(in_use, Relaxed);
        Self {
            in_use,
            requested: REQUESTED.load(Relaxed),
        }
    }

    /// What was requested since then.
    pub(crate) fn measure(&self) -> MemoryUse {
        MemoryUse {
            peak: PEAK.load(Relaxed).saturating_sub(self.in_use),
            requested: REQUESTED.load(Relaxed).wrapping_sub(self.requested),
        }
    }
}
