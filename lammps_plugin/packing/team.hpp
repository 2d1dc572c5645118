#pragma once

#include <condition_variable>
#include <cstddef>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

namespace jamshape {

/// Numbers from first to before last.
struct Range {
  std::size_t first, last;
};

/// The k-th of so many parts of n things, whichever thread is faster.
inline Range part_of(std::size_t n, std::size_t k, std::size_t parts)
{
  return {n * k / parts, n * (k + 1) / parts};
}

/// Threads that wait for work that is done in parts, one of them by whoever asks for it.
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

  /// Does each part, by its number, and waits for all; throws what the first part that failed
  /// threw.
  void run(const std::function<void(std::size_t)> &part)
  {
    {
      const std::lock_guard<std::mutex> lock(guard);
      work = &part;
      left = others.size();
      ++round;
    }
    begin.notify_all();
    attempt(part, 0);
    std::unique_lock<std::mutex> lock(guard);
    end.wait(lock, [this] { return left == 0; });
    work = nullptr;
    for (std::exception_ptr &one : failed) {
      if (!one) continue;
      const std::exception_ptr first = one;
      failed.assign(failed.size(), nullptr);
      std::rethrow_exception(first);
    }
  }

 private:
  std::mutex guard;
  std::condition_variable begin, end;
  const std::function<void(std::size_t)> *work = nullptr;
  std::size_t left = 0, round = 0;
  bool is_over = false;
  std::vector<std::exception_ptr> failed;  // one for each part
  std::vector<std::thread> others;

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
    std::unique_lock<std::mutex> lock(guard);
    for (std::size_t done = 0;;) {
      begin.wait(lock, [&] { return is_over || round != done; });
      if (is_over) return;
      done = round;
      const std::function<void(std::size_t)> &part = *work;
      lock.unlock();
      attempt(part, k);
      lock.lock();
      if (--left == 0) end.notify_one();
    }
  }

  void dismiss()
  {
    {
      const std::lock_guard<std::mutex> lock(guard);
      is_over = true;
    }
    begin.notify_all();
    for (std::thread &one : others) one.join();
  }
};

/// `work` on each part of n things, by a team if there is one.
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
