#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace jamshape {

/// Numbers from first up to, but excluding, last.
struct Range {
  std::size_t first, last;
};

/// The k-th of `parts` parts of n items, independent of the speed of threads.
inline Range part_of(std::size_t n, std::size_t k, std::size_t parts)
{
  return {n * k / parts, n * (k + 1) / parts};
}

/// Threads that wait for work done in parts, one of them by the caller.
class Team {
 public:
  explicit Team(std::size_t n) : failed(n)
  {
    try {
      for (std::size_t k = 1; k < n; ++k) others.emplace_back([this, k] { serve(k); });
    } catch (...) {
      dismiss();
      throw;
    }
  }
  ~Team() { dismiss(); }
  Team(const Team &) = delete;
  Team &operator=(const Team &) = delete;

  std::size_t size() const { return failed.size(); }

  /// Executes each part, by its number, and waits for all; rethrows the exception of the first part
  /// that failed.
  void run(const std::function<void(std::size_t)> &part)
  {
    work = &part;
    left = others.size();
    tell(begin, [this] { ++round; });
    attempt(part, 0);
    await(end, [this] { return left == 0; });
    const auto first =
        std::find_if(failed.begin(), failed.end(), [](const auto &one) { return one != nullptr; });
    if (first == failed.end()) return;
    const std::exception_ptr thrown = *first;
    failed.assign(failed.size(), nullptr);
    std::rethrow_exception(thrown);
  }

 private:
  using Clock = std::chrono::steady_clock;

  /// Waking a thread takes as long as the contacts of some hundred particles: a waiting thread
  /// polls for this time before it sleeps.
  static constexpr std::chrono::microseconds AWAKE{50};

  std::mutex guard;
  std::condition_variable begin, end;
  const std::function<void(std::size_t)> *work = nullptr;
  std::atomic<std::size_t> left{0}, round{0};
  std::atomic<bool> is_over{false};
  std::vector<std::exception_ptr> failed;  // one for each part
  std::vector<std::thread> others;

  template <class Change> void tell(std::condition_variable &those, const Change &change)
  {
    {
      const std::lock_guard<std::mutex> lock(guard);
      change();
    }
    those.notify_all();
  }

  template <class Ready> void await(std::condition_variable &where, const Ready &is_ready)
  {
    for (const auto until = Clock::now() + AWAKE; Clock::now() < until; std::this_thread::yield()) {
      if (is_ready()) return;
    }
    std::unique_lock<std::mutex> lock(guard);
    where.wait(lock, is_ready);
  }

  void attempt(const std::function<void(std::size_t)> &part, std::size_t k)
  {
    try {
      part(k);
    } catch (...) {
      failed[k] = std::current_exception();
    }
  }

  void serve(std::size_t k)
  {
    for (std::size_t done = 0;;) {
      await(begin, [&] { return is_over || round != done; });
      if (is_over) return;
      done = round;
      attempt(*work, k);
      tell(end, [this] { --left; });
    }
  }

  void dismiss()
  {
    tell(begin, [this] { is_over = true; });
    for (std::thread &one : others) one.join();
  }
};

/// Calls `work` on each part of n items, by a team if there is one.
template <class Work> void in_parts(Team *team, std::size_t n, const Work &work)
{
  if (team == nullptr) {
    work(0, Range{0, n});
  } else {
    team->run([&](std::size_t k) { work(k, part_of(n, k, team->size())); });
  }
}

inline std::size_t parts_of(const Team *team) { return team == nullptr ? 1 : team->size(); }

}  // namespace jamshape
